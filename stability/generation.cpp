#include "stability/generation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "stability/resting_poses.h"
#include "stability/shape_families.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

constexpr int kTriesPerDropped = 12;   // drops of one object before the scene is begun anew
constexpr int kTriesPerStacked = 4;    // the same in stacks, where what lies below decides more
constexpr double kGravity = 9.81;
// A drop from anywhere above the neighbourhood comes to rest alone four times of five. So more of them are aimed over an
// object or between two, and most that have come to rest alone are shoved towards their neighbour.
constexpr double kShareOver = 0.85, kShareBridging = 0.3, kShareShoved = 0.25;
constexpr double kOverReach = 0.3, kNearReach = 0.9;     // of the sum of the two radii
constexpr double kLeastShove = 0.9, kLargestShove = 1.1;  // of the object's weight
constexpr double kShoveSeconds = 0.4;                     // simulated
constexpr double kLongestDrop = 2.0;                     // simulated seconds; what still moves then is dropped anew
constexpr double kLargestSizeRatio = 3.0;                // between the diameters of two objects of a scene
constexpr double kStretch = 0.25;                        // of general shapes along x and y, in logarithms
constexpr int kShapesPerFamily = 64;                     // of every family, stretched and scaled from scene to scene
constexpr std::uint64_t kShapeStream = 0x5ca1ab1e0ddba11ull;  // apart from the numbers that scenes draw

// World-frame bounding box of an object at a pose.
BoundingBox world_box(const Object& object, const Pose& T_world_object) {
  BoundingBox box;
  box.min.setConstant(std::numeric_limits<double>::infinity());
  box.max = -box.min;
  for (const Eigen::Vector3d& v : object.mesh.vertices) {
    const Eigen::Vector3d p = T_world_object * v;
    box.min = box.min.cwiseMin(p);
    box.max = box.max.cwiseMax(p);
  }
  return box;
}

// Height of the highest thing under (or beside, within `gap`) the footprint of `box`.
double support_height(const Scene& scene, const BoundingBox& box, double gap) {
  double height = 0.0;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const BoundingBox other = world_box(*scene.objects[i], scene.T_world_object[i]);
    const bool apart = other.min.x() > box.max.x() + gap || other.max.x() < box.min.x() - gap ||
                       other.min.y() > box.max.y() + gap || other.max.y() < box.min.y() - gap;
    if (!apart) height = std::max(height, other.max.z());
  }
  return height;
}

// The pose with this orientation and x, y that hangs just above everything beneath it.
Pose pose_above(const Scene& scene, const Object& object, const Eigen::Matrix3d& R, double x, double y, double gap) {
  Pose pose = make_pose(R, {x, y, 0.0});
  const BoundingBox box = world_box(object, pose);
  pose.translation().z() = support_height(scene, box, gap) + gap - box.min.z();
  return pose;
}

double radius(const Object& object) { return object.diameter / 2.0; }

// At least three corners share the greatest height.
bool has_flat_top(const Object& object, const Eigen::Matrix3d& R_world_object) {
  std::vector<double> heights;
  for (const Eigen::Vector3d& v : object.mesh.vertices) heights.push_back((R_world_object * v).z());
  const double top = *std::max_element(heights.begin(), heights.end());
  return std::count_if(heights.begin(), heights.end(),
                       [&](double z) { return z > top - 1e-4 * object.diameter; }) >= 3;
}

// A dropped object starts at most this far above what it may hit.
double drop_gap(const Object& object) { return 0.02 * object.diameter; }

Eigen::Vector2d mean_position(const Scene& scene) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Pose& pose : scene.T_world_object) mean += pose.translation().head<2>();
  return scene.objects.empty() ? mean : Eigen::Vector2d(mean / static_cast<double>(scene.objects.size()));
}

std::uint32_t bit_of(int object) { return 1u << (object + 1); }  // the table is object -1

std::vector<std::uint32_t> touch_masks(std::size_t count, const std::vector<std::pair<int, int>>& touching) {
  std::vector<std::uint32_t> masks(count, 0);
  for (const auto& [a, b] : touching) {
    if (a >= 0) masks[a] |= bit_of(b);
    if (b >= 0) masks[b] |= bit_of(a);
  }
  return masks;
}

}  // namespace

ShapeFamily shape_family_from_string(const std::string& name) {
  if (name == "blocks") return ShapeFamily::kBlocks;
  if (name == "general") return ShapeFamily::kGeneral;
  throw std::invalid_argument("unknown shapes '" + name + "'; choose blocks or general");
}

struct SceneGenerator::Impl {
  GenerationOptions options;
  std::vector<ObjectPtr> shapes;  // blocks at their own size are shared by all scenes, so that their models are kept
  struct Range {
    int first = 0, last = 0;
  };
  std::vector<Range> families;  // of general scenes, in `shapes`
  std::map<const Object*, std::vector<RestingPose>> resting;
  SimulatorCache simulators;
  GenerationStatistics statistics;

  explicit Impl(const GenerationOptions& o)
      : options(o), simulators(o.physics, o.shapes == ShapeFamily::kBlocks ? 1024 : 16) {
    if (o.shapes == ShapeFamily::kBlocks) {
      shapes = all_blocks();
    } else {
      draw_families();
    }
  }

  // The base shapes of general scenes: a few of every family, drawn from the seed, and the blocks as one family more.
  void draw_families() {
    const auto add_family = [&](std::vector<ObjectPtr> family) {
      const int first = static_cast<int>(shapes.size());
      families.push_back({first, first + static_cast<int>(family.size()) - 1});
      shapes.insert(shapes.end(), family.begin(), family.end());
    };
    for (const std::string& name : shape_family_names()) {
      std::vector<ObjectPtr> family;
      for (int i = 0; i < kShapesPerFamily; ++i) {
        Rng rng = make_rng(options.seed ^ kShapeStream, shapes.size() + family.size());
        family.push_back(draw_shape(shape_family_kind_from_string(name), rng));
      }
      add_family(std::move(family));
    }
    add_family(all_blocks());
  }

  // One object's shape and scale.
  struct Draw {
    int shape = 0;
    Eigen::Vector3d scale = Eigen::Vector3d::Ones();
    ObjectPtr object;
  };

  Draw draw_object(Rng& rng) {
    Draw draw;
    if (options.shapes == ShapeFamily::kBlocks) {
      draw.shape = uniform_int(rng, 0, static_cast<int>(shapes.size()) - 1);
      draw.object = shapes[draw.shape];
      return draw;
    }
    // Each family as often as any other; diameters lie within a factor of three about that of the 50 mm cube.
    const Range family = families[uniform_int(rng, 0, static_cast<int>(families.size()) - 1)];
    draw.shape = uniform_int(rng, family.first, family.last);
    const double wanted = kShapeDiameter * std::exp(uniform(rng, -0.5, 0.5) * std::log(kLargestSizeRatio));
    const Eigen::Vector3d stretch = draw_stretch(shapes[draw.shape]->kind, rng);
    draw.scale = stretch * (wanted / diameter(scaled(shapes[draw.shape]->mesh, stretch)));
    draw.object = scaled(*shapes[draw.shape], draw.scale);
    return draw;
  }

  // Proportions beyond those of the drawn shapes. Boxes have all of theirs already.
  static Eigen::Vector3d draw_stretch(SolidKind kind, Rng& rng) {
    const double x = std::exp(uniform(rng, -kStretch, kStretch)), y = std::exp(uniform(rng, -kStretch, kStretch));
    switch (kind) {
      case SolidKind::kBox:
      case SolidKind::kSphere: return Eigen::Vector3d::Ones();
      case SolidKind::kCylinder: return {x, x, 1.0};
      case SolidKind::kMesh: return {x, y, 1.0};
    }
    return Eigen::Vector3d::Ones();
  }

  const std::vector<RestingPose>& resting_of(const Object& object, std::vector<RestingPose>& own) {
    if (options.shapes != ShapeFamily::kBlocks) return own = resting_poses(object.mesh);
    auto& kept = resting[&object];
    if (kept.empty()) kept = resting_poses(object.mesh);
    return kept;
  }

  // A random yaw of a random resting pose, of those with a flat top if another object is to stand on it; nullopt if
  // there is none.
  std::optional<Eigen::Matrix3d> resting_orientation(const Object& object, bool carries, Rng& rng) {
    std::vector<RestingPose> own;
    std::vector<Eigen::Matrix3d> choices;
    for (const RestingPose& pose : resting_of(object, own)) {
      if (!carries || has_flat_top(object, pose.R_world_object)) choices.push_back(pose.R_world_object);
    }
    const double yaw = uniform(rng, 0.0, 2.0 * M_PI);
    if (choices.empty()) return std::nullopt;
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    return turn * choices[uniform_int(rng, 0, static_cast<int>(choices.size()) - 1)];
  }

  // Where to drop `object`; nullopt if it cannot be part of the stack.
  std::optional<Pose> propose(const Scene& scene, const Object& object, Rng& rng) {
    const double gap = drop_gap(object);
    if (options.task == Task::kStack) {
      const bool carries = static_cast<int>(scene.objects.size()) + 1 < options.objects;
      const auto orientation = resting_orientation(object, carries, rng);
      if (!orientation) return std::nullopt;
      const Eigen::Matrix3d R = *orientation;
      if (scene.objects.empty()) return pose_above(scene, object, R, 0.0, 0.0, gap);
      const Object& below = *scene.objects.back();
      const double sigma = 0.15 * std::min(radius(below), radius(object)) * 2.0;
      const Eigen::Vector3d& at = scene.T_world_object.back().translation();
      return pose_above(scene, object, R, at.x() + normal(rng, sigma), at.y() + normal(rng, sigma), gap);
    }
    return propose_near(scene, object, rng);
  }

  // Above what is there: over an object, over the middle between two, or anywhere near.
  Pose propose_near(const Scene& scene, const Object& object, Rng& rng) {
    const Eigen::Matrix3d any = random_rotation(rng);
    const Eigen::Matrix3d R = uniform(rng) < 0.5 ? any : resting_orientation(object, false, rng).value_or(any);
    Eigen::Vector2d at = Eigen::Vector2d::Zero();
    if (!scene.objects.empty()) {
      const int last = static_cast<int>(scene.objects.size()) - 1;
      const int target = uniform_int(rng, 0, last), other = uniform_int(rng, 0, last);
      at = scene.T_world_object[target].translation().head<2>();
      if (uniform(rng) < kShareBridging) at = (at + scene.T_world_object[other].translation().head<2>()) / 2.0;
      const double reach = uniform(rng) < kShareOver ? kOverReach : kNearReach;
      const double distance = reach * (radius(*scene.objects[target]) + radius(object)) * uniform(rng);
      const double angle = uniform(rng, 0.0, 2.0 * M_PI);
      at += distance * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    }
    return pose_above(scene, object, R, at.x(), at.y(), drop_gap(object));
  }

  // A push along the table towards the nearest other object, for a new one that has come to rest alone: it slides up to
  // it, or tips over and leans on it.
  SettleResult shove(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& poses, Rng& rng) {
    const Eigen::Vector2d from = poses.back().translation().head<2>();
    Eigen::Vector2d nearest = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i + 1 < poses.size(); ++i) {
      const Eigen::Vector2d way = poses[i].translation().head<2>() - from;
      if (way.norm() < nearest.norm()) nearest = way;
    }
    const double weight = options.physics.density * objects.back()->volume * kGravity;
    const Eigen::Vector2d force = uniform(rng, kLeastShove, kLargestShove) * weight * nearest.normalized();
    Loads loads;
    loads.forces.assign(objects.size(), Eigen::Vector3d::Zero());
    loads.forces.back() = {force.x(), force.y(), 0.0};
    loads.forces_until = kShoveSeconds;
    return simulators.get(objects).run(poses, loads, {kLongestDrop, true});
  }

  // The scene with the last object at rest alone, if that is how it would end with the others fixed in place, which costs
  // a fifth of the real thing. Such drops would be thrown away.
  std::optional<std::vector<Pose>> foresee_alone(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& poses) {
    if (options.task == Task::kStack || objects.size() == 1) return std::nullopt;
    std::vector<bool> fixed(objects.size(), true);
    fixed.back() = false;
    const SettleResult settled = simulators.get(objects, fixed).run(poses, {}, {kLongestDrop, true});
    ++statistics.foreseen;
    return lies_alone(settled) ? std::make_optional(settled.T_world_object) : std::nullopt;
  }

  // `apart`: the new object may lie on the table touching no other.
  bool acceptable(const SettleResult& settled, bool apart) const {
    if (settled.status != SettleStatus::kSettled) return false;
    const std::vector<std::uint32_t> masks = touch_masks(settled.T_world_object.size(), settled.touching);
    const int last = static_cast<int>(masks.size()) - 1;
    if (last == 0) return true;
    if (options.task == Task::kStack) {
      // Each object stands on the one before and on nothing else.
      for (int i = 0; i <= last; ++i) {
        std::uint32_t expected = bit_of(i - 1);
        if (i < last) expected |= bit_of(i + 1);
        if (masks[i] != expected) return false;
      }
      return true;
    }
    return apart || !lies_alone(settled);
  }

  // The last object has come to rest on the table and touches no other.
  static bool lies_alone(const SettleResult& settled) {
    const std::size_t count = settled.T_world_object.size();
    return settled.status == SettleStatus::kSettled && count > 1 &&
           touch_masks(count, settled.touching).back() == bit_of(-1);
  }

  // Drops one object until it comes to rest as wanted; false after too many tries.
  bool add_object(SceneRecord& record, Scene& scene, Rng& rng) {
    const int tries = options.task == Task::kStack ? kTriesPerStacked : kTriesPerDropped;
    const Draw draw = draw_object(rng);
    const bool apart = uniform(rng) < options.apart;
    std::vector<ObjectPtr> objects = scene.objects;
    objects.push_back(draw.object);
    for (int attempt = 0; attempt < tries; ++attempt) {
      const std::optional<Pose> proposal = propose(scene, *draw.object, rng);
      if (!proposal) return false;
      std::vector<Pose> poses = scene.T_world_object;
      poses.push_back(*proposal);
      const auto alone = apart ? std::nullopt : foresee_alone(objects, poses);
      if (alone && uniform(rng) > kShareShoved) continue;
      const SettleResult settled =
          alone ? shove(objects, *alone, rng) : simulators.get(objects).run(poses, {}, {kLongestDrop, true});
      ++statistics.drops;
      statistics.shoves += alone ? 1 : 0;
      if (!acceptable(settled, apart)) continue;
      ++statistics.accepted;
      record.objects.push_back({draw.shape, draw.scale, Pose::Identity(), 0});
      const std::vector<std::uint32_t> masks = touch_masks(objects.size(), settled.touching);
      for (std::size_t i = 0; i < objects.size(); ++i) {
        record.objects[i].T_world_object = settled.T_world_object[i];
        record.objects[i].touches = masks[i];
      }
      scene = {objects, settled.T_world_object};
      return true;
    }
    return false;
  }
};

SceneGenerator::SceneGenerator(const GenerationOptions& options) {
  if (options.objects < 1 || options.objects > 6) {
    throw std::invalid_argument("a scene has 1 to 6 objects, not " + std::to_string(options.objects));
  }
  if ((options.task == Task::kSingle) != (options.objects == 1)) {
    throw std::invalid_argument("single scenes have one object, stacks and unstructured scenes two to six; got " +
                                to_string(options.task) + " with " + std::to_string(options.objects));
  }
  impl_ = std::make_unique<Impl>(options);
}

SceneGenerator::~SceneGenerator() = default;

SceneRecord SceneGenerator::generate(std::int64_t index) {
  return *generate(index, [] { return false; });
}

std::optional<SceneRecord> SceneGenerator::generate(std::int64_t index, const std::function<bool()>& stop) {
  Rng rng = make_rng(impl_->options.seed, static_cast<std::uint64_t>(index));
  while (true) {
    SceneRecord record;
    record.task = impl_->options.task;
    record.index = index;
    Scene scene;
    bool whole = true;
    for (int i = 0; i < impl_->options.objects && whole; ++i) {
      if (stop()) return std::nullopt;
      whole = impl_->add_object(record, scene, rng);
    }
    if (whole) return record;
    ++impl_->statistics.restarts;
  }
}

const std::vector<ObjectPtr>& SceneGenerator::shapes() const { return impl_->shapes; }
const GenerationStatistics& SceneGenerator::statistics() const { return impl_->statistics; }

std::string to_json(const GenerationOptions& o) {
  const nlohmann::json json = {
      {"task", to_string(o.task)},
      {"objects", o.objects},
      {"shapes", o.shapes == ShapeFamily::kBlocks ? "blocks" : "general"},
      {"seed", o.seed},
      {"apart", o.apart},
      {"density", o.physics.density},
      {"friction", o.physics.friction},
      {"timestep", o.physics.timestep},
      {"rest_time", o.physics.rest_time},
      {"rest_shift", o.physics.rest_shift},
      {"rest_turn", o.physics.rest_turn},
  };
  return json.dump();
}

Pose random_placement(const Scene& context, const Object& query, Task task, Rng& rng) {
  const Eigen::Matrix3d R = random_rotation(rng);
  Eigen::Vector2d at = mean_position(context);
  if (task == Task::kStack && !context.objects.empty()) {
    const auto highest = std::max_element(
        context.T_world_object.begin(), context.T_world_object.end(),
        [](const Pose& a, const Pose& b) { return a.translation().z() < b.translation().z(); });
    at = highest->translation().head<2>();
  } else {
    const double dx = normal(rng, query.diameter), dy = normal(rng, query.diameter);
    at += Eigen::Vector2d(dx, dy);
  }
  return pose_above(context, query, R, at.x(), at.y(), 1e-3 * query.diameter);
}

}  // namespace dofusion
