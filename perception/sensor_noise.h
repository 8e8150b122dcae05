// Depth sensors' errors, added to exact scans. Every term is a function of its own, with its source.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "perception/camera.h"
#include "perception/miscalibration.h"
#include "perception/scanner.h"
#include "stability/random.h"

namespace dofusion {

enum class SensorModel { kNone, kKinect, kKinect2, kRealsense, kAzure };
const std::vector<std::string>& sensor_names();  // in the order of SensorModel
std::string to_string(SensorModel sensor);
SensorModel sensor_from_string(const std::string& name);  // throws std::invalid_argument naming the choices

// The depth image that the sensor makes of an exact scan (with normals, from Scanner::render). `noise_scale` multiplies
// every standard deviation, step and probability: 0 gives the exact depth, 1 the sensor as published. Throws
// std::invalid_argument if the scale is negative or the scan is not of the camera's size.
DepthImage apply_sensor_noise(const Scan& scan, const Camera& camera, SensorModel sensor, double noise_scale, Rng& rng);

// The terms of which a sensor is composed; without any, a sensor is exact.
struct SensorTerms {
  double (*axial_sigma)(double depth, double incidence) = nullptr;  // metres, from metres and radians
  double (*lateral_sigma_px)(double incidence) = nullptr;           // of each image coordinate
  double correlation_px = 0.0;     // axial and lateral noise change over this length (smooth_noise.h); 0: from pixel
                                   // to pixel
  double warp_px = 0.0;            // disparity error that bends planes, standard deviation; pixels as below
  double warp_length_px = 60.0;    // over which the warp changes (smooth_noise.h)
  double disparity_step_px = 0.0;  // quantisation, of a 0.075 m baseline and 585.5 px focal length; 0: none
  double grazing_limit_deg = 0.0;  // no reading where the ray meets the surface at less than this (Handa: 8)
  double incidence_drop = 0.0;     // times 1 - cos(incidence): probability of no reading; see sensor_terms
  double edge_drop = 0.0;          // probability of no reading at a pixel beside a depth step
  double edge_fly = 0.0;           // probability of a flying pixel there
  double hole_share = 0.0;         // of all pixels that lie in holes; see in_holes
  double hole_length_px = 4.0;     // over which holes open and close
  Miscalibration calibration;      // of the camera; for `miscalibrated`, no part of the image
};

// A sensor as it is taken here. The Kinect's is calibrated: Khoshelham and Elberink's random error and Handa et al.'s
// lateral shift, correlated over a few pixels, steps of 1/8 px, and a warp. On a table it scatters as the real frames
// do (plane_noise.h); `sensor_calibration` prints both. Nguyen et al.'s increase of the axial noise beyond 60 degrees
// is left out: the frames, which reach 65 degrees, do not show it. The others are as published. No sensor has holes or
// a miscalibration of its own, for which there is no source, and none uses incidence_drop: at 1 it would take half of a
// table seen at 60 degrees, whereas 45 frames of a first Kinect (mOSD, tables seen at 40 to 60 degrees) have no hole
// inside a table in 6.4 million pixels.
SensorTerms sensor_terms(SensorModel sensor);

// The Kinect of Nguyen et al. with Handa et al.'s quantisation, every pixel for itself. On a table seen at 50 degrees
// it scatters about twice what the real frames do: its lateral noise was measured at the edge of a board, where pixels
// change sides, and on a slope it adds to the depth.
SensorTerms published_kinect_terms();

DepthImage apply_sensor_noise(const Scan& scan, const Camera& camera, const SensorTerms& terms, double noise_scale,
                              Rng& rng);

// Standard deviations of the depth in metres; depth in metres, incidence (between ray and surface normal) in
// radians, below pi / 2.
double kinect_axial_sigma(double depth, double incidence);   // Nguyen, Izadi and Lovell 2012, equations 2 and 3
double khoshelham_sigma(double depth, double incidence);     // Khoshelham and Elberink 2012; of any incidence
double kinect2_axial_sigma(double depth, double incidence);  // Fankhauser et al. 2015
double realsense_sigma(double depth, double incidence);      // D435 at 848 x 480, Intel's depth tuning guide
double azure_sigma(double depth, double incidence);          // BlenderProc's model

// Standard deviations of the image position in pixels.
double kinect_lateral_sigma_px(double incidence);  // Nguyen, Izadi and Lovell 2012, equation 1
double handa_lateral_sigma_px(double incidence);   // Handa et al. 2014: 0.5
double azure_lateral_sigma_px(double incidence);   // BlenderProc's model

// Khoshelham and Elberink's depth step in metres, 2.85e-3 z^2. It is a step of 1/8 px of disparity
// (quantise_disparity), written as depth; so no term of its own.
double khoshelham_depth_step(double depth);

// The depth after the disparity has changed by `error_px` (pixels of quantise_disparity); 0 if none is left.
double shift_disparity(double depth, double error_px);

// 1 where a pixel lies in a hole, a blob without readings: where smooth noise of `length_px` is among its highest
// `share` values. Blobs are a few lengths wide and take `share` of a large image.
Image<std::uint8_t> in_holes(int width, int height, double share, double length_px, Rng& rng);

// The depth after rounding the disparity f B / depth to steps of `step_px` (Handa et al. 2014: 1/8 px, f B of the
// first Kinect); 0 if the disparity rounds to 0.
double quantise_disparity(double depth, double step_px);

// The depth at image position (u, v) of the plane tangent to the scanned surface at pixel (row, column).
double tangent_depth(const Scan& scan, const Camera& camera, int row, int column, double u, double v);

// Depth of the neighbour (of four) across the largest depth step beside a pixel; a step is a neighbour that lies more
// than kEdgeStep off the pixel's tangent plane, seen from the camera. No value where there is none; 0 if the step is
// to where nothing is hit.
inline constexpr double kEdgeStep = 0.01;  // metres
std::optional<double> depth_across_edge(const Scan& scan, const Camera& camera, int row, int column);

// Angle between the ray through a pixel that hit something and the normal there, in [0, pi / 2].
double incidence_angle(const Scan& scan, const Camera& camera, int row, int column);

}  // namespace dofusion
