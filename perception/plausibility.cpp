#include "perception/plausibility.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "perception/convex_body.h"

namespace dofusion {
namespace {

constexpr double kLittle = 0.2;                  // motion (see the header) that needs no second try: 2 % or 2 degrees
constexpr double kTopplesDeg = 5.0;              // an object that turns more topples
constexpr double kAside[] = {0.03, 0.07, 0.15};  // of the diameter
constexpr int kDirections = 8;                   // round the vertical
constexpr int kRounds = 2;                       // of shifts, one object each
constexpr double kLift = 1e-4;                   // metres; what is shifted must not catch on what it slides over

// The convex solids of an object where it is.
using Solids = std::vector<TriangleMesh>;

Solids placed(const Object& object, const Pose& T_world_object) {
  Solids solids = object.parts;
  if (solids.empty()) solids.push_back(object.mesh);
  for (TriangleMesh& solid : solids) {
    for (Eigen::Vector3d& v : solid.vertices) v = T_world_object * v;
  }
  return solids;
}

void translate(const Eigen::Vector3d& by, Solids& solids, Pose& pose) {
  pose.translation() += by;
  for (TriangleMesh& solid : solids) solid = translated(solid, by);
}

double lowest(const Solids& solids) {
  double z = bounding_box(solids.front()).min.z();
  for (const TriangleMesh& solid : solids) z = std::min(z, bounding_box(solid).min.z());
  return z;
}

// The deepest overlap of two objects. Non-convex objects without parts overlap nothing.
Overlap deepest_overlap(const Scene& scene, std::size_t a, const Solids& solids_a, std::size_t b,
                        const Solids& solids_b) {
  Overlap deepest;
  for (const std::size_t i : {a, b}) {
    if (!scene.objects[i]->convex && scene.objects[i]->parts.empty()) return deepest;
  }
  for (const TriangleMesh& solid_a : solids_a) {
    for (const TriangleMesh& solid_b : solids_b) {
      const Overlap overlap = find_overlap(solid_a, solid_b);
      if (overlap.depth > deepest.depth) deepest = overlap;
    }
  }
  return deepest;
}

// Lifts what reaches below the table; returns whether anything did.
bool lift_off_table(std::vector<Solids>& solids, std::vector<Pose>& poses, double tolerance) {
  bool moved = false;
  for (std::size_t i = 0; i < solids.size(); ++i) {
    const double below = -lowest(solids[i]);
    if (below <= tolerance) continue;
    translate({0.0, 0.0, below}, solids[i], poses[i]);
    moved = true;
  }
  return moved;
}

// Moves the two apart along the least translation: up the one above, else sideways in shares by their volume.
void push_apart(const Overlap& overlap, std::size_t a, std::size_t b, const Scene& scene, std::vector<Solids>& solids,
                std::vector<Pose>& poses) {
  constexpr double kSteep = 0.7;  // of the axis; nearer to the vertical the upper object is lifted
  const double mass_a = scene.objects[a]->volume, mass_b = scene.objects[b]->volume;
  double share_b = mass_a / (mass_a + mass_b);
  if (overlap.axis.z() > kSteep) share_b = 1.0;
  if (overlap.axis.z() < -kSteep) share_b = 0.0;
  translate(-(1.0 - share_b) * overlap.depth * overlap.axis, solids[a], poses[a]);
  translate(share_b * overlap.depth * overlap.axis, solids[b], poses[b]);
}

std::vector<Pose> without_overlaps(const Scene& scene, std::vector<Pose> poses) {
  constexpr int kPasses = 20;
  constexpr double kTolerance = 1e-4;  // metres; the physics' contacts are as soft
  std::vector<Solids> solids;
  for (std::size_t i = 0; i < poses.size(); ++i) solids.push_back(placed(*scene.objects[i], poses[i]));
  for (int pass = 0; pass < kPasses; ++pass) {
    bool moved = lift_off_table(solids, poses, kTolerance);
    for (std::size_t a = 0; a < solids.size(); ++a) {
      for (std::size_t b = a + 1; b < solids.size(); ++b) {
        const Overlap overlap = deepest_overlap(scene, a, solids[a], b, solids[b]);
        if (overlap.depth <= kTolerance) continue;
        push_apart(overlap, a, b, scene, solids, poses);
        moved = true;
      }
    }
    if (!moved) break;
  }
  return poses;
}

// A try: where the objects were let go, and what became of them.
struct Attempt {
  std::vector<Pose> start;  // before overlaps are undone
  SettleResult settled;
  double motion = std::numeric_limits<double>::infinity();  // from the recovered poses; infinite if it diverged
};

class Search {
 public:
  Search(const Scene& recovered, const PhysicsOptions& physics)
      : recovered_(recovered), simulator_(recovered.objects, physics) {}

  Attempt attempt(const std::vector<Pose>& start) {
    ++attempts_;
    Attempt tried{start, simulator_.settle(without_overlaps(recovered_, start))};
    if (tried.settled.status == SettleStatus::kDiverged) return tried;
    tried.motion = motion(displacement(recovered_.objects, recovered_.T_world_object, tried.settled.T_world_object));
    if (tried.settled.status == SettleStatus::kTimeLimit) tried.motion += 1.0;  // it may go on moving
    return tried;
  }

  // The best of the given attempt and of one object let go aside, for every object that may be at fault.
  Attempt best_shift(const Attempt& before) {
    Attempt best = before;
    for (const std::size_t i : suspects(before)) {
      for (const double aside : kAside) {
        for (int k = 0; k < kDirections && best.motion > kLittle; ++k) {
          const double angle = 2.0 * M_PI * k / kDirections;
          const Eigen::Vector3d direction(std::cos(angle), std::sin(angle), 0.0);
          std::vector<Pose> start = before.start;
          start[i].translation() += aside * recovered_.objects[i]->diameter * direction + Eigen::Vector3d(0, 0, kLift);
          Attempt tried = attempt(start);
          if (tried.motion < best.motion) best = std::move(tried);
        }
      }
    }
    return best;
  }

  int attempts() const { return attempts_; }

 private:
  // The object that topples most and what is below it; if the simulation diverged or nothing topples, none.
  std::vector<std::size_t> suspects(const Attempt& attempt) const {
    std::size_t worst = 0;
    double most = 0.0;
    if (attempt.settled.status == SettleStatus::kDiverged) return {};
    for (std::size_t i = 0; i < recovered_.objects.size(); ++i) {
      const Eigen::Matrix3d turn =
          recovered_.T_world_object[i].linear().transpose() * attempt.settled.T_world_object[i].linear();
      if (rotation_angle(turn) > most) most = rotation_angle(turn), worst = i;
    }
    if (most * 180.0 / M_PI < kTopplesDeg) return {};
    std::vector<std::size_t> found = {worst};
    const BoundingBox upper = box_of(worst);
    for (std::size_t i = 0; i < recovered_.objects.size(); ++i) {
      const BoundingBox lower = box_of(i);
      const bool over = (upper.min.head<2>().array() < lower.max.head<2>().array()).all() &&
                        (lower.min.head<2>().array() < upper.max.head<2>().array()).all();
      if (i != worst && over && lower.min.z() < upper.min.z()) found.push_back(i);
    }
    if (found.size() > 2) found.resize(2);
    return found;
  }

  BoundingBox box_of(std::size_t i) const {
    TriangleMesh mesh = recovered_.objects[i]->mesh;
    for (Eigen::Vector3d& v : mesh.vertices) v = recovered_.T_world_object[i] * v;
    return bounding_box(mesh);
  }

  const Scene& recovered_;
  Simulator simulator_;
  int attempts_ = 0;
};

// Everything a hair higher and farther apart than it was: contacts that were too deep or too many are not there then.
std::vector<Pose> spread(const Scene& scene, double share) {
  std::vector<Pose> poses = scene.T_world_object;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Pose& pose : poses) centre += pose.translation() / static_cast<double>(poses.size());
  for (Pose& pose : poses) {
    const Eigen::Vector3d out = pose.translation() - centre;
    pose.translation() += share * Eigen::Vector3d(out.x(), out.y(), std::max(0.0, pose.translation().z()));
  }
  return poses;
}

}  // namespace

double motion(const Displacement& displacement) {
  return std::max(displacement.translation_pct / kStableTranslationPct, displacement.rotation_deg / kStableRotationDeg);
}

PlausibleScene make_plausible(const Scene& recovered, const PhysicsOptions& options) {
  PlausibleScene result{recovered, 0.0, 0.0, SettleStatus::kSettled, 0};
  if (recovered.objects.empty()) return result;
  Search search(recovered, options);
  Attempt best = search.attempt(recovered.T_world_object);
  for (const double share : {0.01, 0.03, 0.1}) {
    if (best.settled.status != SettleStatus::kDiverged) break;
    best = search.attempt(spread(recovered, share));
  }
  for (int round = 0; round < kRounds && best.motion > kLittle; ++round) {
    const double before = best.motion;
    best = search.best_shift(best);
    if (!(best.motion < before)) break;
  }
  result.attempts = search.attempts();
  result.status = best.settled.status;
  if (result.status == SettleStatus::kDiverged) return result;
  const Displacement moved = displacement(recovered.objects, recovered.T_world_object, best.settled.T_world_object);
  result.scene.T_world_object = best.settled.T_world_object;
  result.moved_pct = moved.translation_pct;
  result.moved_deg = moved.rotation_deg;
  return result;
}

}  // namespace dofusion
