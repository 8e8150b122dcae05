#include "perception/plausibility.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "perception/convex_body.h"

namespace dofusion {
namespace {

constexpr double kNearPct = 5.0, kNearDeg = 5.0;  // a scene that moved less needs no second attempt

TriangleMesh placed(const Object& object, const Pose& T_world_object) {
  TriangleMesh mesh = object.mesh;
  for (Eigen::Vector3d& v : mesh.vertices) v = T_world_object * v;
  return mesh;
}

// Lifts what reaches below the table; returns whether anything did.
bool lift_off_table(std::vector<TriangleMesh>& meshes, std::vector<Pose>& poses, double tolerance) {
  bool moved = false;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const double below = -bounding_box(meshes[i]).min.z();
    if (below <= tolerance) continue;
    poses[i].translation().z() += below;
    meshes[i] = translated(meshes[i], {0.0, 0.0, below});
    moved = true;
  }
  return moved;
}

// Moves the two apart along the least translation: up the one above, else sideways in shares by their volume.
void push_apart(const Overlap& overlap, std::size_t a, std::size_t b, const Scene& scene,
                std::vector<TriangleMesh>& meshes, std::vector<Pose>& poses) {
  constexpr double kSteep = 0.7;  // of the axis; nearer to the vertical the upper object is lifted
  const double mass_a = scene.objects[a]->volume, mass_b = scene.objects[b]->volume;
  double share_b = mass_a / (mass_a + mass_b);
  if (overlap.axis.z() > kSteep) share_b = 1.0;
  if (overlap.axis.z() < -kSteep) share_b = 0.0;
  const Eigen::Vector3d move_a = -(1.0 - share_b) * overlap.depth * overlap.axis;
  const Eigen::Vector3d move_b = share_b * overlap.depth * overlap.axis;
  poses[a].translation() += move_a;
  poses[b].translation() += move_b;
  meshes[a] = translated(meshes[a], move_a);
  meshes[b] = translated(meshes[b], move_b);
}

std::vector<Pose> without_overlaps(const Scene& scene) {
  constexpr int kRounds = 20;
  constexpr double kTolerance = 1e-4;  // metres; the physics' contacts are as soft
  std::vector<Pose> poses = scene.T_world_object;
  std::vector<TriangleMesh> meshes;
  for (std::size_t i = 0; i < poses.size(); ++i) meshes.push_back(placed(*scene.objects[i], poses[i]));
  for (int round = 0; round < kRounds; ++round) {
    bool moved = lift_off_table(meshes, poses, kTolerance);
    for (std::size_t a = 0; a < meshes.size(); ++a) {
      for (std::size_t b = a + 1; b < meshes.size(); ++b) {
        if (!scene.objects[a]->convex || !scene.objects[b]->convex) continue;
        const Overlap overlap = find_overlap(meshes[a], meshes[b]);
        if (overlap.depth <= kTolerance) continue;
        push_apart(overlap, a, b, scene, meshes, poses);
        moved = true;
      }
    }
    if (!moved) break;
  }
  return poses;
}

// Every object higher by `lift` than the one next below it: what leans wrongly gets another chance to find its hold.
std::vector<Pose> spread_upwards(std::vector<Pose> poses, double lift) {
  std::vector<std::size_t> order(poses.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return poses[a].translation().z() < poses[b].translation().z();
  });
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    poses[order[rank]].translation().z() += lift * static_cast<double>(rank);
  }
  return poses;
}

PlausibleScene settled_from(const Scene& recovered, const std::vector<Pose>& start, const PhysicsOptions& options) {
  PlausibleScene result{recovered, 0.0, 0.0, SettleStatus::kDiverged, 1};
  const SettleResult settled = Simulator(recovered.objects, options).settle(start);
  result.status = settled.status;
  if (settled.status == SettleStatus::kDiverged) return result;
  const Displacement moved = displacement(recovered.objects, recovered.T_world_object, settled.T_world_object);
  result.scene.T_world_object = settled.T_world_object;
  result.moved_pct = moved.translation_pct;
  result.moved_deg = moved.rotation_deg;
  return result;
}

// Least motion, a per cent of the diameter as bad as a degree; scenes that have come to rest before all others.
bool is_better(const PlausibleScene& a, const PlausibleScene& b) {
  if (a.status != b.status) return a.status < b.status;
  return std::max(a.moved_pct, a.moved_deg) < std::max(b.moved_pct, b.moved_deg);
}

}  // namespace

PlausibleScene make_plausible(const Scene& recovered, const PhysicsOptions& options) {
  constexpr double kLifts[] = {0.001, 0.003};  // metres
  if (recovered.objects.empty()) return {recovered, 0.0, 0.0, SettleStatus::kSettled};
  const auto is_near = [](const PlausibleScene& scene) {
    return scene.status == SettleStatus::kSettled && scene.moved_pct < kNearPct && scene.moved_deg < kNearDeg;
  };
  const std::vector<Pose> parted = without_overlaps(recovered);
  PlausibleScene best = settled_from(recovered, parted, options);
  std::vector<std::vector<Pose>> others = {recovered.T_world_object};
  for (const double lift : kLifts) others.push_back(spread_upwards(parted, lift));
  int attempts = 1;
  for (const std::vector<Pose>& start : others) {
    if (is_near(best)) break;
    PlausibleScene other = settled_from(recovered, start, options);
    ++attempts;
    if (is_better(other, best)) best = std::move(other);
  }
  best.attempts = attempts;
  return best;
}

}  // namespace dofusion
