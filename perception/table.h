// The plane that the objects stand on.
#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

#include "perception/camera.h"
#include "perception/image.h"
#include "perception/recovery.h"

namespace dofusion {

// Standard deviation of a depth reading: sigma(z) = constant + quadratic * z^2, all in metres. The default is what a
// Kinect shows on a table (0.81 mm at 0.66 m … 2.29 mm at 1.17 m).
struct DepthSigma {
  double constant = 0.0;      // metres
  double quadratic = 1.7e-3;  // 1 / metre
  double operator()(double z) const { return constant + quadratic * z * z; }
};

struct TableOptions {
  DepthSigma sigma;        // first guess of the noise; the band is refined by the table's own residuals
  double band = 3.0;       // sigmas; readings nearer to the plane than this belong to it
  double min_share = 0.1;  // of the valid pixels that must lie on the plane
  int min_inliers = 200;   // pixels that must lie on the plane
  double max_depth = 8.0;  // metres; readings beyond are ignored
  int max_ransac_points = 6000;
  int ransac_iterations = 400;
};

// A plane in the camera's frame as a·X = 1. A pixel's ray r = (x, y, 1) meets it at the inverse depth 1/z = a·r, which
// is linear in the pixel's coordinates and has (nearly) the same noise everywhere.
using InversePlane = Eigen::Vector3d;

inline bool is_valid_depth(float z) { return std::isfinite(z) && z > 0.0F; }

// The ray (x, y, 1) through a pixel.
inline Eigen::Vector3d pixel_ray(const Camera& camera, double u, double v) {
  return {(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0};
}

// The table that most readings lie on: RANSAC in inverse depth (PCL), then weighted least squares inside a band that
// follows sigma(z). nullopt if no plane holds enough readings, as in images without a valid reading, of one pixel or
// row, or of noise; readings that are not finite or not positive count as none. Images of any size, at a cost that
// grows with their pixels. The plane is whichever the camera sees most of, seen from its front: a lid where something
// covers the table completely, a wall from inside a box, the lower side from below the table. Throws
// std::invalid_argument if the image is not of the camera's size or the camera's focal lengths are not positive.
std::optional<Table> find_table(const DepthImage& depth, const Camera& camera, const TableOptions& options = {});

// The table as an inverse plane. The camera must be above the table.
InversePlane table_plane(const Table& table);

// A table at the given inverse plane (world frame as defined at Table); inliers and residual are left 0.
Table table_from_plane(const InversePlane& plane);

// `prior` scaled so that the readings near the table scatter about it by one sigma (robust; between a quarter and
// sixteen times the prior). The prior itself if there are too few.
DepthSigma calibrate_sigma(const DepthImage& depth, const Camera& camera, const Table& table,
                           const DepthSigma& prior = {});

// How much the sensor bends a plane: root mean square, in `sigma`s, of the table's deviations averaged over small
// blocks of pixels, beyond what independent noise leaves there. 0 if the table has too few whole blocks.
double measure_warp(const DepthImage& depth, const Camera& camera, const Table& table, const DepthSigma& sigma);

// Throws std::invalid_argument unless the image has the camera's size and the camera has positive focal lengths.
void check_image_size(int width, int height, const Camera& camera);

}  // namespace dofusion
