#include "apps/refine.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stability/mesh_symmetry.h"
#include "stability/metrics.h"
#include "stability/random.h"
#include "stability/sdf.h"

namespace dofusion {

double pose_distance(const Object& object, const std::vector<Eigen::Matrix3d>& symmetries, const Pose& a, const Pose& b) {
  const double shift_pct = 100.0 * (a.translation() - b.translation()).norm() / object.diameter;
  double angle = rotation_angle(a.linear().transpose() * b.linear());
  for (const Eigen::Matrix3d& symmetry : symmetries) {
    angle = std::min(angle, rotation_angle(a.linear().transpose() * b.linear() * symmetry));
  }
  return std::max(shift_pct / kStableTranslationPct, angle * 180.0 / M_PI / kStableRotationDeg);
}

void rank_by_agreement(const Object& query, const Pose& T_world_estimate, std::vector<Placement>& placements) {
  const std::vector<Eigen::Matrix3d> symmetries = rotation_symmetries(query.mesh);
  std::vector<std::pair<double, std::size_t>> order;  // key, index: stable ones have the smaller keys
  for (std::size_t i = 0; i < placements.size(); ++i) {
    if (!placements[i].stable) {
      order.emplace_back(1e6 + pose_distance(query, symmetries, placements[i].T_world_query, T_world_estimate), i);
      continue;
    }
    std::vector<double> distances;
    for (const Placement& other : placements) {
      if (other.stable)
        distances.push_back(pose_distance(query, symmetries, placements[i].T_world_query, other.T_world_query));
    }
    order.emplace_back(median(distances) + (placements[i].unmet.empty() ? 0.0 : 1e3), i);
  }
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Placement> ranked;
  for (const auto& [key, i] : order) ranked.push_back(std::move(placements[i]));
  placements = std::move(ranked);
}

std::optional<std::size_t> seen_as(const Scene& scene, const Object& query, const Pose& T_world_estimate,
                                   double least_share) {
  constexpr int kPoints = 2000;  // in the query's bounding box
  const MeshDistance in_query(query.mesh);
  const BoundingBox box = bounding_box(query.mesh);
  Rng rng = make_rng(0x72656669u);
  std::vector<Eigen::Vector3d> points;  // inside the query, world
  for (int i = 0; i < kPoints; ++i) {
    const double x = uniform(rng, box.min.x(), box.max.x()), y = uniform(rng, box.min.y(), box.max.y());
    const Eigen::Vector3d p(x, y, uniform(rng, box.min.z(), box.max.z()));
    if (in_query(p) < 0.0) points.push_back(T_world_estimate * p);
  }
  std::optional<std::size_t> best;
  double most = least_share * static_cast<double>(points.size());
  for (std::size_t k = 0; k < scene.objects.size(); ++k) {
    const MeshDistance in_object(scene.objects[k]->mesh);
    const Pose T_object_world = scene.T_world_object[k].inverse();
    const auto inside = static_cast<double>(std::count_if(
        points.begin(), points.end(), [&](const Eigen::Vector3d& p) { return in_object(T_object_world * p) < 0.0; }));
    if (inside < most || points.empty()) continue;
    most = inside;
    best = k;
  }
  return best;
}

void remove_object(RecoveredScene& recovered, std::size_t object) {
  const auto at = static_cast<std::ptrdiff_t>(object);
  recovered.objects.erase(recovered.objects.begin() + at);
  recovered.scene.objects.erase(recovered.scene.objects.begin() + at);
  recovered.scene.T_world_object.erase(recovered.scene.T_world_object.begin() + at);
  const auto removed = static_cast<int>(kLabelFirstObject + object);
  for (std::uint8_t& label : recovered.labels.pixels) {
    if (label == removed) label = kLabelNothing;
    if (label > removed) --label;
  }
  for (std::size_t i = 0; i < recovered.objects.size(); ++i) {
    recovered.objects[i].label = kLabelFirstObject + static_cast<int>(i);
  }
}

}  // namespace dofusion
