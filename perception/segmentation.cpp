#include "perception/segmentation.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <numeric>

#include "perception/face_joining.h"

namespace dofusion {
namespace {

constexpr int kMaxObjects = 254;
constexpr std::array<std::pair<int, int>, 4> kNeighbours{{{0, 1}, {0, -1}, {1, 0}, {-1, 0}}};

// Height of every reading above the table's plane, in sigmas; NaN where there is no reading.
Image<float> table_deviations(const DepthImage& depth, const Camera& camera, const InversePlane& table,
                              const FaceOptions& options) {
  Image<float> deviation(depth.width, depth.height, std::numeric_limits<float>::quiet_NaN());
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      const double z = depth.at(v, u);
      if (!is_valid_depth(depth.at(v, u))) continue;
      const double sigma = inverse_sigma(z, table, camera, options);
      deviation.at(v, u) = static_cast<float>((1.0 / z - table.dot(pixel_ray(camera, u, v))) / sigma);
    }
  }
  return deviation;
}

double height_above(const InversePlane& table, const Eigen::Vector3d& point) {
  return (1.0 - table.dot(point)) / table.norm();
}

// 4-connected components of the pixels where `inside` is not zero: 0 outside, 1, 2, … ; sizes[i] of component i.
struct Components {
  Image<int> index;
  std::vector<int> sizes{0};
};

Components connected_components(const Image<std::uint8_t>& inside) {
  Components components{Image<int>(inside.width, inside.height, 0), {0}};
  std::vector<std::pair<int, int>> stack;
  for (int v0 = 0; v0 < inside.height; ++v0) {
    for (int u0 = 0; u0 < inside.width; ++u0) {
      if (!inside.at(v0, u0) || components.index.at(v0, u0)) continue;
      const int number = static_cast<int>(components.sizes.size());
      components.sizes.push_back(0);
      components.index.at(v0, u0) = number;
      stack.assign(1, {v0, u0});
      while (!stack.empty()) {
        const auto [v, u] = stack.back();
        stack.pop_back();
        ++components.sizes[number];
        for (const auto& [dv, du] : kNeighbours) {
          if (!inside.contains(v + dv, u + du) || !inside.at(v + dv, u + du)) continue;
          if (components.index.at(v + dv, u + du)) continue;
          components.index.at(v + dv, u + du) = number;
          stack.emplace_back(v + dv, u + du);
        }
      }
    }
  }
  return components;
}

// Readings above the table's band in clusters that are large enough to matter.
Image<std::uint8_t> pixels_above_table(const DepthImage& depth, const Camera& camera, const InversePlane& table,
                                       const Image<float>& deviation, const SegmentationOptions& options) {
  Image<std::uint8_t> above(depth.width, depth.height, 0);
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      if (!(deviation.at(v, u) > options.table_band)) continue;
      if (height_above(table, unproject(camera, u, v, depth.at(v, u))) < options.max_height) above.at(v, u) = 1;
    }
  }
  const Components clusters = connected_components(above);
  for (std::size_t p = 0; p < above.pixels.size(); ++p) {
    if (clusters.sizes[clusters.index.pixels[p]] < options.min_pixels) above.pixels[p] = 0;
  }
  return above;
}

// The mask and the readings within a few pixels of it, so that a face can claim its foot from the table's band.
Image<std::uint8_t> with_margin(const Image<std::uint8_t>& mask, const Image<float>& deviation, double band) {
  constexpr int kMarginPx = 4;
  Image<std::uint8_t> wide(mask.width, mask.height, 0);
  for (int v = 0; v < mask.height; ++v) {
    for (int u = 0; u < mask.width; ++u) {
      if (!mask.at(v, u)) continue;
      for (int y = std::max(0, v - kMarginPx); y <= std::min(mask.height - 1, v + kMarginPx); ++y) {
        for (int x = std::max(0, u - kMarginPx); x <= std::min(mask.width - 1, u + kMarginPx); ++x) {
          if (deviation.at(y, x) > -band) wide.at(y, x) = 1;
        }
      }
    }
  }
  return wide;
}

// Object numbers per pixel, -1 for none: those of the faces, spread over the readings beside them that have no face
// and follow without a step in depth, then whole clusters in which no face was found.
Image<int> number_pixels(const DepthImage& depth, const Camera& camera, const FaceMap& map,
                         const std::vector<int>& object_of_face, const Image<std::uint8_t>& above,
                         const FaceOptions& options) {
  Image<int> number(depth.width, depth.height, -1);
  for (std::size_t p = 0; p < number.pixels.size(); ++p) {
    const int face = map.index.pixels[p];
    if (face != kNoFace) number.pixels[p] = object_of_face[face];
  }
  constexpr int kSpreadPx = 4;
  for (int step = 0; step < kSpreadPx; ++step) {
    const Image<int> before = number;
    for (int v = 0; v < depth.height; ++v) {
      for (int u = 0; u < depth.width; ++u) {
        if (!above.at(v, u) || before.at(v, u) >= 0 || map.index.at(v, u) != kNoFace) continue;
        const double z = depth.at(v, u);
        double nearest = 4.0 * options.sigma(z) + 3.0 * z / camera.fx;  // metres; three pixels deep
        for (const auto& [dv, du] : kNeighbours) {
          if (!depth.contains(v + dv, u + du) || before.at(v + dv, u + du) < 0) continue;
          const double gap = std::abs(depth.at(v + dv, u + du) - z);
          if (gap < nearest) nearest = gap, number.at(v, u) = before.at(v + dv, u + du);
        }
      }
    }
  }
  Image<std::uint8_t> left(depth.width, depth.height, 0);
  for (std::size_t p = 0; p < left.pixels.size(); ++p) {
    left.pixels[p] = above.pixels[p] && number.pixels[p] < 0 && map.index.pixels[p] == kNoFace;
  }
  const int faces_end =
      object_of_face.empty() ? 0 : 1 + *std::max_element(object_of_face.begin(), object_of_face.end());
  const Components rest = connected_components(left);
  for (std::size_t p = 0; p < left.pixels.size(); ++p) {
    if (left.pixels[p]) number.pixels[p] = std::max(0, faces_end) + rest.index.pixels[p] - 1;
  }
  return number;
}

struct Extent {
  int pixels = 0;
  double area = 0.0;       // square metres, seen head-on
  double deviation = 0.0;  // mean, in sigmas above the table
};

// Labels for the objects that are large enough and stand out of the table's band, by falling number of pixels.
LabelImage label_objects(const DepthImage& depth, const Camera& camera, const Image<int>& number,
                         const Image<float>& deviation, const SegmentationOptions& options) {
  std::map<int, Extent> extents;
  for (std::size_t p = 0; p < number.pixels.size(); ++p) {
    if (number.pixels[p] < 0) continue;
    Extent& extent = extents[number.pixels[p]];
    const double z = depth.pixels[p];
    extent.pixels += 1;
    extent.area += z * z / (camera.fx * camera.fy);
    extent.deviation += deviation.pixels[p];
  }
  std::vector<std::pair<int, int>> order;  // (-pixels, number)
  for (const auto& [n, extent] : extents) {
    if (extent.pixels < options.min_pixels || extent.area < options.min_area) continue;
    if (extent.deviation < 1.5 * options.table_band * extent.pixels) continue;
    order.emplace_back(-extent.pixels, n);
  }
  std::sort(order.begin(), order.end());
  if (order.size() > kMaxObjects) order.resize(kMaxObjects);
  std::map<int, std::uint8_t> label_of;
  for (std::size_t i = 0; i < order.size(); ++i) {
    label_of[order[i].second] = static_cast<std::uint8_t>(kLabelFirstObject + i);
  }
  LabelImage labels(depth.width, depth.height, kLabelNothing);
  for (std::size_t p = 0; p < number.pixels.size(); ++p) {
    const auto found = label_of.find(number.pixels[p]);
    if (found != label_of.end()) labels.pixels[p] = found->second;
  }
  return labels;
}

void label_table(LabelImage& labels, const Image<float>& deviation, double band) {
  for (std::size_t p = 0; p < labels.pixels.size(); ++p) {
    if (labels.pixels[p] == kLabelNothing && std::abs(deviation.pixels[p]) <= band) labels.pixels[p] = kLabelTable;
  }
}

SegmentationOptions calibrated(const DepthImage& depth, const Camera& camera, const Table& table,
                               SegmentationOptions options) {
  if (options.calibrate) {
    options.sigma = calibrate_sigma(depth, camera, table, options.sigma);
    options.warp = measure_warp(depth, camera, table, options.sigma);
  }
  options.faces.sigma = options.sigma;
  return options;
}

}  // namespace

LabelImage segment(const DepthImage& depth, const Camera& camera, const Table& table,
                   const SegmentationOptions& user_options) {
  check_image_size(depth.width, depth.height, camera);
  const SegmentationOptions options = calibrated(depth, camera, table, user_options);
  const InversePlane plane = table_plane(table);
  const Image<float> deviation = table_deviations(depth, camera, plane, options.faces);
  const Image<std::uint8_t> above = pixels_above_table(depth, camera, plane, deviation, options);
  const FaceMap faces =
      find_faces(depth, camera, with_margin(above, deviation, options.table_band), {plane}, options.faces);
  const std::vector<int> object_of_face = join_faces(faces, depth, camera, options);
  const Image<int> number = number_pixels(depth, camera, faces, object_of_face, above, options.faces);
  LabelImage labels = label_objects(depth, camera, number, deviation, options);
  label_table(labels, deviation, options.table_band);
  return labels;
}

LabelImage segment_with_mask(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& mask,
                             const SegmentationOptions& user_options) {
  check_image_size(depth.width, depth.height, camera);
  check_image_size(mask.width, mask.height, camera);
  const SegmentationOptions options = calibrated(depth, camera, table, user_options);
  const InversePlane plane = table_plane(table);
  const Image<float> deviation = table_deviations(depth, camera, plane, options.faces);
  const Image<std::uint8_t> above = pixels_above_table(depth, camera, plane, deviation, options);
  std::array<int, 256> pixels{};
  for (std::size_t p = 0; p < mask.pixels.size(); ++p) pixels[mask.pixels[p]] += above.pixels[p];
  std::array<std::uint8_t, 256> label_of{};
  std::uint8_t next = kLabelFirstObject;
  for (int value = kLabelFirstObject; value < 256; ++value) {
    if (pixels[value] >= options.min_pixels) label_of[value] = next++;
  }
  LabelImage labels(depth.width, depth.height, kLabelNothing);
  for (std::size_t p = 0; p < mask.pixels.size(); ++p) {
    if (above.pixels[p]) labels.pixels[p] = label_of[mask.pixels[p]];
  }
  label_table(labels, deviation, options.table_band);
  return labels;
}

int count_objects(const LabelImage& labels) {
  const auto largest = std::max_element(labels.pixels.begin(), labels.pixels.end());
  return largest == labels.pixels.end() ? 0 : std::max(0, *largest - kLabelTable);
}

}  // namespace dofusion
