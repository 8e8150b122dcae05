#include "perception/object_view.h"

#include <algorithm>
#include <cmath>

namespace dofusion {
namespace {

constexpr double kOutliers = 0.005;  // share of the points beyond a robust bound

HalfSpace to_world(const InversePlane& plane, const Pose& T_world_camera) {
  const Eigen::Vector3d normal = T_world_camera.linear() * -plane.normalized();
  return {normal, normal.dot(T_world_camera.translation()) - 1.0 / plane.norm()};
}

// Joins faces that show one plane in pieces: inclined less than a few degrees and not offset.
std::vector<ObservedFace> merged(std::vector<ObservedFace> faces, double tolerance) {
  const double kSameDirection = std::cos(10.0 * M_PI / 180.0);
  std::stable_sort(faces.begin(), faces.end(), [](const auto& a, const auto& b) { return a.pixels > b.pixels; });
  std::vector<ObservedFace> result;
  for (const ObservedFace& face : faces) {
    const auto same = std::find_if(result.begin(), result.end(), [&](const ObservedFace& other) {
      return other.plane.normal.dot(face.plane.normal) > kSameDirection &&
             std::abs(other.plane.normal.dot(face.centre) - other.plane.offset) < tolerance;
    });
    if (same == result.end()) {
      result.push_back(face);
      continue;
    }
    const double share = static_cast<double>(face.pixels) / (face.pixels + same->pixels);
    same->centre += share * (face.centre - same->centre);
    same->plane.normal = ((1.0 - share) * same->plane.normal + share * face.plane.normal).normalized();
    same->plane.offset = same->plane.normal.dot(same->centre);
    same->pixels += face.pixels;
  }
  return result;
}

}  // namespace

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto rank = static_cast<std::ptrdiff_t>(std::lround(share * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

Range robust_range(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& direction) {
  std::vector<double> along;
  along.reserve(points.size());
  for (const Eigen::Vector3d& p : points) along.push_back(direction.dot(p));
  return {quantile(along, kOutliers), quantile(along, 1.0 - kOutliers)};
}

ObjectView view_object(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
                       int label, const FaceOptions& options) {
  Image<std::uint8_t> mask(depth.width, depth.height, 0);
  ObjectView view;
  view.label = label;
  for (std::size_t p = 0; p < mask.pixels.size(); ++p) {
    if (labels.pixels[p] != label) continue;
    mask.pixels[p] = 1;
    ++view.pixels;
  }
  const FaceMap map = find_faces(depth, camera, mask, {}, options);
  std::vector<ObservedFace> faces(map.faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) faces[f].plane = to_world(map.faces[f].plane, table.T_world_camera);
  double sigma_sum = 0.0;
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      if (!mask.at(v, u) || !is_valid_depth(depth.at(v, u))) continue;
      const int f = map.index.at(v, u);
      if (f == kNoFace && !faces.empty()) continue;
      const double z = depth.at(v, u);
      const Eigen::Vector3d point = table.T_world_camera * unproject(camera, u, v, z);
      view.points.push_back(point);
      view.sigma.push_back(options.sigma(z));
      sigma_sum += options.sigma(z);
      if (f == kNoFace) continue;
      faces[f].centre += point;
      faces[f].pixels += 1;
    }
  }
  if (view.points.empty()) return view;
  for (ObservedFace& face : faces) face.centre /= std::max(1, face.pixels);
  view.faces = merged(std::move(faces), 4.0 * sigma_sum / static_cast<double>(view.points.size()));
  view.lowest = robust_range(view.points, Eigen::Vector3d::UnitZ()).low;
  return view;
}

ObjectView joined(const std::vector<ObjectView>& views) {
  ObjectView all;
  for (const ObjectView& view : views) {
    if (view.points.empty()) continue;
    all.label = view.label;
    all.pixels += view.pixels;
    all.points.insert(all.points.end(), view.points.begin(), view.points.end());
    all.sigma.insert(all.sigma.end(), view.sigma.begin(), view.sigma.end());
    all.faces.insert(all.faces.end(), view.faces.begin(), view.faces.end());
  }
  if (all.points.empty()) return all;
  double sigma_sum = 0.0;
  for (const double sigma : all.sigma) sigma_sum += sigma;
  all.faces = merged(std::move(all.faces), 4.0 * sigma_sum / static_cast<double>(all.sigma.size()));
  all.lowest = robust_range(all.points, Eigen::Vector3d::UnitZ()).low;
  return all;
}

}  // namespace dofusion
