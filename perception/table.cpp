#include "perception/table.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Dense>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_plane.h>

namespace dofusion {
namespace {

struct Reading {
  Eigen::Vector3d ray;   // (x, y, 1)
  double inverse = 0.0;  // 1/z, 1/metre
  double sigma = 0.0;    // of the inverse depth, 1/metre
};

std::vector<Reading> valid_readings(const DepthImage& depth, const Camera& camera, const TableOptions& options) {
  std::vector<Reading> readings;
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      const double z = depth.at(v, u);
      if (!is_valid_depth(depth.at(v, u)) || z > options.max_depth) continue;
      readings.push_back({pixel_ray(camera, u, v), 1.0 / z, std::max(options.sigma(z), 1e-6) / (z * z)});
    }
  }
  return readings;
}

// A plane is linear in (x, y, 1/z). The image coordinates are stretched so that PCL's distance, which is orthogonal
// to the plane, is the difference in inverse depth.
std::optional<InversePlane> ransac_plane(const std::vector<Reading>& readings, const TableOptions& options) {
  constexpr double kStretch = 100.0;
  const std::size_t step = readings.size() / std::max(options.max_ransac_points, 3) + 1;
  auto cloud = std::make_shared<pcl::PointCloud<pcl::PointXYZ>>();
  double sigma = 0.0;
  for (std::size_t i = 0; i < readings.size(); i += step) {
    const Reading& r = readings[i];
    cloud->push_back({static_cast<float>(kStretch * r.ray.x()), static_cast<float>(kStretch * r.ray.y()),
                      static_cast<float>(r.inverse)});
    sigma += r.sigma;
  }
  if (cloud->size() < 3) return std::nullopt;
  auto model = std::make_shared<pcl::SampleConsensusModelPlane<pcl::PointXYZ>>(cloud);
  pcl::RandomSampleConsensus<pcl::PointXYZ> ransac(model, options.band * sigma / cloud->size());
  ransac.setMaxIterations(options.ransac_iterations);
  if (!ransac.computeModel()) return std::nullopt;
  Eigen::VectorXf p;  // p0 X + p1 Y + p2 / z + p3 = 0
  ransac.getModelCoefficients(p);
  if (std::abs(p[2]) < 1e-9F) return std::nullopt;
  const Eigen::Vector3d plane(-kStretch * p[0] / p[2], -kStretch * p[1] / p[2], -p[3] / p[2]);
  return plane.allFinite() ? std::optional<InversePlane>(plane) : std::nullopt;
}

struct PlaneFit {
  InversePlane plane;
  int inliers = 0;
  double scale = 1.0;  // standard deviation of the inliers in sigmas
};

// Least squares on the readings within `band` sigmas of the plane, repeated; the band follows the scatter found.
std::optional<PlaneFit> refine_plane(const std::vector<Reading>& readings, const InversePlane& start, double band) {
  PlaneFit fit{start, 0, 1.0};
  for (int iteration = 0; iteration < 6; ++iteration) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    double squares = 0.0;
    int inliers = 0;
    for (const Reading& r : readings) {
      const double e = (r.inverse - fit.plane.dot(r.ray)) / r.sigma;
      if (std::abs(e) > band * fit.scale) continue;
      const double weight = 1.0 / (r.sigma * r.sigma);
      A += weight * r.ray * r.ray.transpose();
      b += weight * r.inverse * r.ray;
      squares += e * e;
      ++inliers;
    }
    if (inliers < 3) return std::nullopt;
    const Eigen::Vector3d plane = A.ldlt().solve(b);
    if (!plane.allFinite()) return std::nullopt;
    fit.plane = plane;
    fit.inliers = inliers;
    fit.scale = std::clamp(std::sqrt(squares / inliers), 0.25, 2.0);
  }
  return fit;
}

double root_mean_square(const std::vector<Reading>& readings, const PlaneFit& fit, double band) {
  double sum = 0.0;
  int count = 0;
  for (const Reading& r : readings) {
    if (std::abs(r.inverse - fit.plane.dot(r.ray)) > band * fit.scale * r.sigma) continue;
    const double distance = (1.0 - fit.plane.dot(r.ray) / r.inverse) / fit.plane.norm();
    sum += distance * distance;
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : 0.0;
}

// A reading's distance to the plane in sigmas.
double deviation(double z, const Eigen::Vector3d& ray, const InversePlane& plane, const DepthSigma& sigma) {
  return (1.0 / z - plane.dot(ray)) * z * z / std::max(sigma(z), 1e-6);
}

constexpr double kNearTable = 8.0;  // sigmas; readings further off say nothing of the table's noise

}  // namespace

void check_image_size(int width, int height, const Camera& camera) {
  if (width != camera.width || height != camera.height) {
    throw std::invalid_argument("image of " + std::to_string(width) + "x" + std::to_string(height) +
                                " pixels, but the camera has " + std::to_string(camera.width) + "x" +
                                std::to_string(camera.height));
  }
  if (!(camera.fx > 0.0 && camera.fy > 0.0)) throw std::invalid_argument("camera without a positive focal length");
}

InversePlane table_plane(const Table& table) {
  const Eigen::Vector3d up = table.T_world_camera.linear().transpose().col(2);
  return -up / table.T_world_camera.translation().z();
}

Table table_from_plane(const InversePlane& plane) {
  const Eigen::Vector3d up = -plane.normalized();  // towards the camera
  const double height = 1.0 / plane.norm();        // of the camera
  Eigen::Vector3d x = Eigen::Vector3d::UnitX() - up.x() * up;
  if (x.norm() < 1e-6) x = Eigen::Vector3d::UnitY() - up.y() * up;
  x.normalize();
  const bool axis_meets_table = plane.z() > 1e-6;
  const Eigen::Vector3d origin = axis_meets_table ? Eigen::Vector3d(0, 0, 1.0 / plane.z()) : -height * up;
  Eigen::Matrix3d R_camera_world;
  R_camera_world << x, up.cross(x), up;
  Table table;
  table.T_world_camera = make_pose(R_camera_world, origin).inverse();
  return table;
}

std::optional<Table> find_table(const DepthImage& depth, const Camera& camera, const TableOptions& options) {
  check_image_size(depth.width, depth.height, camera);
  const std::vector<Reading> readings = valid_readings(depth, camera, options);
  const int needed = std::max(options.min_inliers, static_cast<int>(options.min_share * readings.size()));
  if (static_cast<int>(readings.size()) < needed) return std::nullopt;
  const std::optional<InversePlane> coarse = ransac_plane(readings, options);
  if (!coarse) return std::nullopt;
  const std::optional<PlaneFit> fit = refine_plane(readings, *coarse, options.band);
  if (!fit || fit->inliers < needed || fit->plane.norm() < 1e-6) return std::nullopt;
  Table table = table_from_plane(fit->plane);
  table.inliers = fit->inliers;
  table.residual = root_mean_square(readings, *fit, options.band);
  return table;
}

DepthSigma calibrate_sigma(const DepthImage& depth, const Camera& camera, const Table& table, const DepthSigma& prior) {
  const InversePlane plane = table_plane(table);
  std::vector<double> all;
  for (int v = 0; v < depth.height; v += 2) {
    for (int u = 0; u < depth.width; u += 2) {
      if (!is_valid_depth(depth.at(v, u))) continue;
      all.push_back(std::abs(deviation(depth.at(v, u), pixel_ray(camera, u, v), plane, prior)));
    }
  }
  // A sensor far noisier than the prior scatters beyond the window; widen it until the window holds five sigmas.
  double scale = 1.0;
  for (int round = 0; round < 4; ++round) {
    const double window = std::max(kNearTable, 5.0 * scale);
    std::vector<double> deviations;
    std::copy_if(all.begin(), all.end(), std::back_inserter(deviations), [&](double e) { return e < window; });
    if (deviations.size() < 50) return prior;
    const auto middle = deviations.begin() + static_cast<std::ptrdiff_t>(deviations.size() / 2);
    std::nth_element(deviations.begin(), middle, deviations.end());
    scale = std::clamp(*middle / 0.6745, 0.25, 16.0);
  }
  return {prior.constant * scale, prior.quadratic * scale};
}

double measure_warp(const DepthImage& depth, const Camera& camera, const Table& table, const DepthSigma& sigma) {
  constexpr int kBlock = 8;  // pixels
  constexpr int kMinBlocks = 20;
  const InversePlane plane = table_plane(table);
  double squares = 0.0, noise = 0.0;
  int blocks = 0;
  for (int v0 = 0; v0 + kBlock <= depth.height; v0 += kBlock) {
    for (int u0 = 0; u0 + kBlock <= depth.width; u0 += kBlock) {
      double sum = 0.0, sum_squares = 0.0;
      int count = 0;
      for (int v = v0; v < v0 + kBlock; ++v) {
        for (int u = u0; u < u0 + kBlock; ++u) {
          if (!is_valid_depth(depth.at(v, u))) continue;
          const double e = deviation(depth.at(v, u), pixel_ray(camera, u, v), plane, sigma);
          if (std::abs(e) > kNearTable) continue;
          sum += e;
          sum_squares += e * e;
          ++count;
        }
      }
      if (count < kBlock * kBlock * 9 / 10) continue;
      const double mean = sum / count;
      squares += mean * mean;
      noise += std::max(0.0, sum_squares / count - mean * mean) / count;
      ++blocks;
    }
  }
  return blocks < kMinBlocks ? 0.0 : std::sqrt(std::max(0.0, squares - noise) / blocks);
}

}  // namespace dofusion
