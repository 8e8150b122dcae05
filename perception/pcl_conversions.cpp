#include "perception/pcl_conversions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

#include <Eigen/Dense>
#include <pcl/conversions.h>
#include <pcl/io/pcd_io.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_plane.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/extract_clusters.h>

#include "stability/even_samples.h"
#include "stability/files.h"

namespace dofusion {
namespace {

bool is_reading(const pcl::PointXYZ& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z) && p.z > 0.0F;
}

// slope and offset of pixel = slope * ratio + offset, least squares, and its largest error.
struct Line {
  double slope = 0.0, offset = 0.0, error = std::numeric_limits<double>::infinity();
};

Line fit_line(const std::vector<std::pair<double, double>>& ratio_and_pixel) {
  double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (const auto& [x, y] : ratio_and_pixel) n += 1.0, sx += x, sy += y, sxx += x * x, sxy += x * y;
  const double spread = n * sxx - sx * sx;
  if (!(spread > 1e-12)) return {};
  Line line{(n * sxy - sx * sy) / spread, 0.0, 0.0};
  line.offset = (sy - line.slope * sx) / n;
  for (const auto& [x, y] : ratio_and_pixel)
    line.error = std::max(line.error, std::abs(line.slope * x + line.offset - y));
  return line;
}

std::optional<CloudView> organised_view(const Cloud& cloud) {
  constexpr double kHalfPixel = 0.5;
  std::vector<std::pair<double, double>> columns, rows;
  const int width = static_cast<int>(cloud.width), height = static_cast<int>(cloud.height);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const pcl::PointXYZ& p = cloud.at(u, v);
      if (!is_reading(p)) continue;
      columns.emplace_back(p.x / p.z, u);
      rows.emplace_back(p.y / p.z, v);
    }
  }
  const Line x = fit_line(columns), y = fit_line(rows);
  if (x.error > kHalfPixel || y.error > kHalfPixel || x.slope <= 0.0 || y.slope <= 0.0) return std::nullopt;
  CloudView view{{x.slope, y.slope, x.offset, y.offset, width, height, 1.0}, DepthImage(width, height)};
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      if (is_reading(cloud.at(u, v))) view.depth.at(v, u) = cloud.at(u, v).z;
    }
  }
  return view;
}

std::optional<CloudView> virtual_view(const Cloud& cloud, int width) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  int readings = 0;
  for (const pcl::PointXYZ& p : cloud) {
    if (!is_reading(p)) continue;
    const Eigen::Vector2d ratio(p.x / p.z, p.y / p.z);
    low = low.cwiseMin(ratio);
    high = high.cwiseMax(ratio);
    ++readings;
  }
  const Eigen::Vector2d span = high - low;
  if (readings < 3 || !(span.minCoeff() > 1e-9)) return std::nullopt;
  // No more pixels than points, so that the image has few holes.
  const double shape = span.y() / span.x();
  const int columns = std::clamp(static_cast<int>(std::sqrt(0.7 * readings / shape)), 2, std::max(2, width));
  // Not many more rows than columns either: a cloud like a needle would need millions.
  const int most_rows = 4 * std::max(2, width);
  const double focal = std::min((columns - 1) / span.x(), (most_rows - 2) / span.y());
  const int rows = static_cast<int>(std::ceil(focal * span.y())) + 1;
  CloudView view{{focal, focal, -focal * low.x(), -focal * low.y(), columns, rows, 1.0}, DepthImage(columns, rows)};
  for (const pcl::PointXYZ& p : cloud) {
    if (!is_reading(p)) continue;
    const Eigen::Vector2d pixel = project(view.camera, {p.x, p.y, p.z});
    const int u = std::clamp(static_cast<int>(std::lround(pixel.x())), 0, columns - 1);
    const int v = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, rows - 1);
    float& depth = view.depth.at(v, u);
    if (depth == 0.0F || p.z < depth) depth = p.z;
  }
  return view;
}

// Every n-th point, so that no more than so many remain.
Cloud::Ptr thinned(const Cloud& cloud, std::size_t most) {
  auto some = std::make_shared<Cloud>();
  for (std::size_t i = 0; i < cloud.size(); i += cloud.size() / most + 1) some->push_back(cloud[i]);
  return some;
}

// RANSAC on some of the points and least squares on all near the plane found, by PCL, in space; the camera is at the
// origin, below no table.
std::optional<Table> cloud_table(const Cloud::ConstPtr& points, double band, double min_share) {
  constexpr std::size_t kMostRansacPoints = 6000;
  constexpr int kIterations = 400;
  pcl::RandomSampleConsensus<pcl::PointXYZ> ransac(
      std::make_shared<pcl::SampleConsensusModelPlane<pcl::PointXYZ>>(thinned(*points, kMostRansacPoints)), band);
  ransac.setMaxIterations(kIterations);
  if (!ransac.computeModel()) return std::nullopt;
  Eigen::VectorXf rough, fine;
  std::vector<int> inliers;
  ransac.getModelCoefficients(rough);
  auto model = std::make_shared<pcl::SampleConsensusModelPlane<pcl::PointXYZ>>(points);
  model->selectWithinDistance(rough, band, inliers);
  if (static_cast<double>(inliers.size()) < min_share * static_cast<double>(points->size())) return std::nullopt;
  model->optimizeModelCoefficients(inliers, rough, fine);
  const Eigen::Vector3d normal = fine.head<3>().cast<double>();
  if (inliers.size() < 3 || std::abs(fine[3]) < 1e-6F) return std::nullopt;
  Table table = table_from_plane(-normal / static_cast<double>(fine[3]));
  double squares = 0.0;
  for (const int i : inliers)
    squares += std::pow(normal.dot((*points)[i].getVector3fMap().cast<double>()) + fine[3], 2);
  table.inliers = static_cast<int>(inliers.size());
  table.residual = std::sqrt(squares / static_cast<double>(inliers.size()));
  return table;
}

}  // namespace

void write_cloud(const Cloud& cloud, const std::string& path) {
  pcl::PCLPointCloud2 blob;
  pcl::toPCLPointCloud2(cloud, blob);
  std::ostringstream bytes;
  pcl::PCDWriter writer;
  if (writer.writeBinaryCompressed(bytes, blob) != 0) throw InputError(path + ": PCL cannot write these points");
  write_file(path, bytes.str());
}

Cloud to_cloud(const DepthImage& depth, const Camera& camera) {
  check_image_size(depth.width, depth.height, camera);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Cloud cloud(static_cast<std::uint32_t>(depth.width), static_cast<std::uint32_t>(depth.height), {nan, nan, nan});
  cloud.is_dense = false;
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      if (!is_valid_depth(depth.at(v, u))) continue;
      // By index: PCL's at(column, row) refuses a cloud of one row.
      cloud[static_cast<std::size_t>(v) * depth.width + u].getVector3fMap() =
          unproject(camera, u, v, depth.at(v, u)).cast<float>();
    }
  }
  return cloud;
}

SurfaceCloud to_cloud(const Object& object, int count, std::uint64_t seed) {
  Rng rng = make_rng(seed);
  SurfaceCloud cloud;
  for (const SurfaceSample& sample : sample_surface_evenly(object.mesh, count, rng)) {
    pcl::PointNormal point;
    point.getVector3fMap() = sample.point.cast<float>();
    point.getNormalVector3fMap() = sample.normal.cast<float>();
    cloud.push_back(point);
  }
  return cloud;
}

std::optional<CloudView> view_cloud(const Cloud& cloud, int width) {
  if (cloud.isOrganized()) {
    if (std::optional<CloudView> view = organised_view(cloud)) return view;
  }
  return virtual_view(cloud, width);
}

std::optional<CloudSegmentation> segment_cloud(const Cloud& cloud, const CloudSegmentationOptions& options) {
  auto readings = std::make_shared<Cloud>();
  std::vector<std::size_t> index;
  double sigma = 0.0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!is_reading(cloud[i])) continue;
    readings->push_back(cloud[i]);
    index.push_back(i);
    sigma += options.sigma(cloud[i].z);
  }
  if (readings->size() < 3) return std::nullopt;
  const double band = options.table_band * sigma / static_cast<double>(readings->size());
  const std::optional<Table> table = cloud_table(readings, band, options.min_share);
  if (!table) return std::nullopt;

  CloudSegmentation result{*table, std::vector<std::uint8_t>(cloud.size(), kLabelNothing)};
  auto above = std::make_shared<Cloud>();
  std::vector<std::size_t> above_index;
  for (std::size_t i = 0; i < readings->size(); ++i) {
    const double height = (table->T_world_camera * (*readings)[i].getVector3fMap().cast<double>()).z();
    if (std::abs(height) <= band) result.labels[index[i]] = kLabelTable;
    if (height <= band) continue;
    above->push_back((*readings)[i]);
    above_index.push_back(index[i]);
  }
  if (above->empty()) return result;
  std::vector<pcl::PointIndices> clusters;  // by falling size
  auto tree = std::make_shared<pcl::search::KdTree<pcl::PointXYZ>>();
  pcl::EuclideanClusterExtraction<pcl::PointXYZ> extraction;
  extraction.setClusterTolerance(options.cluster_distance);
  extraction.setMinClusterSize(options.min_points);
  extraction.setSearchMethod(tree);
  extraction.setInputCloud(above);
  extraction.extract(clusters);
  for (std::size_t c = 0; c < std::min<std::size_t>(clusters.size(), 254); ++c) {
    for (const int i : clusters[c].indices) {
      result.labels[above_index[i]] = static_cast<std::uint8_t>(kLabelFirstObject + c);
    }
  }
  return result;
}

std::optional<CloudSegmentation> segment_by_convexity(const Cloud& cloud, const SegmentationOptions& options) {
  constexpr float kHidden = 0.01F;  // metres
  const std::optional<CloudView> view = view_cloud(cloud);
  if (!view) return std::nullopt;
  const std::optional<Table> table = find_table(view->depth, view->camera);
  if (!table) return std::nullopt;
  const LabelImage image = segment(view->depth, view->camera, *table, options);
  CloudSegmentation result{*table, std::vector<std::uint8_t>(cloud.size(), kLabelNothing)};
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!is_reading(cloud[i])) continue;
    const Eigen::Vector2d pixel = project(view->camera, cloud[i].getVector3fMap().cast<double>());
    const int u = std::clamp(static_cast<int>(std::lround(pixel.x())), 0, image.width - 1);
    const int v = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, image.height - 1);
    if (cloud[i].z - view->depth.at(v, u) < kHidden) result.labels[i] = image.at(v, u);
  }
  return result;
}

LabelledCloud labelled(const Cloud& cloud, const std::vector<std::uint8_t>& labels) {
  if (labels.size() != cloud.size()) {
    throw std::invalid_argument(std::to_string(labels.size()) + " labels for " + std::to_string(cloud.size()) +
                                " points");
  }
  LabelledCloud result(cloud.width, cloud.height);
  result.header = cloud.header;
  result.is_dense = cloud.is_dense;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    result[i].getVector3fMap() = cloud[i].getVector3fMap();
    result[i].label = labels[i];
  }
  return result;
}

}  // namespace dofusion
