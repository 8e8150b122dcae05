// Depth sensors' errors, added to exact scans. Every term is a function of its own, with its source.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "perception/camera.h"
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
  double disparity_step_px = 0.0;  // quantisation, of a 0.075 m baseline and 585.5 px focal length; 0: none
  double grazing_limit_deg = 0.0;  // no reading where the ray meets the surface at less than this (Handa: 8)
  double incidence_drop = 0.0;     // times 1 - cos(incidence): probability of no reading; see sensor_terms
  double edge_drop = 0.0;          // probability of no reading at a pixel beside a depth step
  double edge_fly = 0.0;           // probability of a flying pixel there
};

// No sensor here uses incidence_drop: at 1 it would take half of a table seen at 60 degrees, whereas 45 frames of a
// first Kinect (mOSD, tables seen at 40 to 60 degrees) have no hole inside a table in 6.4 million pixels.
SensorTerms sensor_terms(SensorModel sensor);
DepthImage apply_sensor_noise(const Scan& scan, const Camera& camera, const SensorTerms& terms, double noise_scale,
                              Rng& rng);

// Standard deviations of the depth in metres; depth in metres, incidence (between ray and surface normal) in
// radians, below pi / 2.
double kinect_axial_sigma(double depth, double incidence);   // Nguyen, Izadi and Lovell 2012, equations 2 and 3
double kinect2_axial_sigma(double depth, double incidence);  // Fankhauser et al. 2015
double realsense_sigma(double depth, double incidence);      // D435 at 848 x 480, Intel's depth tuning guide
double azure_sigma(double depth, double incidence);          // BlenderProc's model

// Standard deviations of the image position in pixels.
double kinect_lateral_sigma_px(double incidence);  // Nguyen, Izadi and Lovell 2012, equation 1
double azure_lateral_sigma_px(double incidence);   // BlenderProc's model

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
