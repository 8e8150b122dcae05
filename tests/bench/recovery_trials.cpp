#include "recovery_trials.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "perception/convex_body.h"
#include "stability/generation.h"
#include "stability/mesh_symmetry.h"
#include "stability/sdf.h"

namespace dofusion {
namespace {

struct Kind {
  const char* name;
  Task task;
  int objects;
};

Kind kind_of(const TrialOptions& options, int index) {
  static const Kind kKinds[] = {{"1", Task::kSingle, 1},
                                {"2 touching", Task::kUnstructured, 2},
                                {"2 stacked", Task::kStack, 2},
                                {"3 touching", Task::kUnstructured, 3},
                                {"3 stacked", Task::kStack, 3}};
  if (options.objects == 0) return kKinds[index % 5];
  if (options.objects == 1) return kKinds[0];
  return kKinds[2 * options.objects - 3 + index % 2];
}

Scene scene_of_blocks(const Kind& kind, std::uint64_t seed, int index) {
  GenerationOptions generation;
  generation.task = kind.task;
  generation.objects = kind.objects;
  generation.seed = seed;
  SceneGenerator generator(generation);
  SceneDataset dataset;
  dataset.shapes = generator.shapes();
  return to_scene(dataset, generator.generate(index));
}

// Boxes with edges from 3 to 10 cm, dropped one after the other.
Scene scene_of_boxes(const Kind& kind, std::uint64_t seed, int index) {
  Rng rng = make_rng(seed, 3000000 + static_cast<std::uint64_t>(index));
  Scene scene;
  for (int attempt = 0; attempt < 1000 && static_cast<int>(scene.objects.size()) < kind.objects; ++attempt) {
    const ObjectPtr box = make_box("box", {uniform(rng, 0.03, 0.1), uniform(rng, 0.03, 0.1), uniform(rng, 0.03, 0.1)});
    Scene larger = scene;
    larger.T_world_object.push_back(random_placement(scene, *box, kind.task, rng));
    larger.objects.push_back(box);
    const SettleResult settled = Simulator(larger.objects).settle(larger.T_world_object);
    if (settled.status != SettleStatus::kSettled) continue;
    larger.T_world_object = settled.T_world_object;
    scene = std::move(larger);
  }
  return scene;
}

std::vector<double> visible_shares(const Scene& scene, const Camera& camera, const std::vector<SyntheticView>& seen) {
  Scanner scanner(scene.objects, {false, 2.0});
  scanner.set_poses(scene.T_world_object);
  const auto count = [](const LabelImage& labels, std::size_t object) {
    return std::count(labels.pixels.begin(), labels.pixels.end(),
                      static_cast<std::uint8_t>(kLabelFirstObject + object));
  };
  std::vector<double> shares(scene.objects.size(), 0.0);
  for (std::size_t i = 0; i < shares.size(); ++i) {
    for (std::size_t j = 0; j < shares.size(); ++j) scanner.set_visible(static_cast<int>(j), i == j);
    for (const SyntheticView& view : seen) {
      const auto silhouette = count(scanner.render(camera, view.T_world_camera).labels, i);
      if (silhouette == 0) continue;
      shares[i] =
          std::max(shares[i], static_cast<double>(count(view.truth.labels, i)) / static_cast<double>(silhouette));
    }
  }
  return shares;
}

ObjectError error_of(const Object& truth, const Pose& T_true, const RecoveredObject& recovered) {
  ObjectError error;
  error.matched = true;
  error.right_shape = recovered.name == truth.name;
  error.translation = (T_true.translation() - recovered.T_world_object.translation()).norm();
  error.angle = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& symmetry : rotation_symmetries(truth.mesh)) {
    error.angle = std::min(error.angle,
                           rotation_angle(T_true.linear().transpose() * recovered.T_world_object.linear() * symmetry));
  }
  return error;
}

// Whether points of the world lie in an object.
class Inside {
 public:
  Inside(const Object& object, const Pose& T_world_object)
      : T_object_world_(T_world_object.inverse()), distance_(object.mesh) {
    if (object.convex) convex_ = half_spaces(object.mesh);
  }
  bool operator()(const Eigen::Vector3d& p_world) const {
    const Eigen::Vector3d p = T_object_world_ * p_world;
    return convex_.empty() ? distance_(p) < 0.0 : plane_distance(convex_, p) < 0.0;
  }

 private:
  Pose T_object_world_;
  MeshDistance distance_;
  std::vector<HalfSpace> convex_;
};

BoundingBox box_around(const Object& object, const Pose& T_world_object) {
  TriangleMesh mesh = object.mesh;
  for (Eigen::Vector3d& v : mesh.vertices) v = T_world_object * v;
  return bounding_box(mesh);
}

}  // namespace

Trial make_trial(const TrialOptions& options, int index) {
  const Kind kind = kind_of(options, index);
  Trial trial;
  trial.kind = kind.name;
  // Groups of ten hold every kind once with blocks and once with boxes.
  const bool boxes = options.shapes == TrialShapes::kBlocksAndBoxes && index / 5 % 2 == 1;
  trial.truth = boxes ? scene_of_boxes(kind, options.seed, index) : scene_of_blocks(kind, options.seed, index);
  const Camera camera = default_camera();
  for (int i = 0; i < options.views; ++i) {
    Rng rng = make_rng(options.seed, 1000000 + 10 * static_cast<std::uint64_t>(index) + static_cast<std::uint64_t>(i));
    trial.seen.push_back(make_synthetic_view(trial.truth, camera, options.viewing, rng));
  }
  trial.visible_share = visible_shares(trial.truth, camera, trial.seen);
  return trial;
}

std::vector<View> views_of(const Trial& trial, int count) {
  std::vector<View> views;
  const Pose T_first_world = trial.seen.front().T_world_camera.inverse();
  for (int i = 0; i < count; ++i) {
    const SyntheticView& seen = trial.seen.at(static_cast<std::size_t>(i));
    views.push_back({seen.depth, default_camera(), T_first_world * seen.T_world_camera, {}});
  }
  return views;
}

std::vector<ObjectError> known_errors(const Scene& truth, const std::vector<RecoveredObject>& recovered) {
  std::vector<ObjectError> errors(truth.objects.size());
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    for (std::size_t j = 0; j < recovered.size(); ++j) {
      const Eigen::Vector3d apart = truth.T_world_object[i].translation() - recovered[j].T_world_object.translation();
      pairs.emplace_back(apart.norm(), i, j);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<bool> used(recovered.size(), false);
  for (const auto& [distance, i, j] : pairs) {
    if (errors[i].matched || used[j] || distance > 0.05) continue;
    errors[i] = error_of(*truth.objects[i], truth.T_world_object[i], recovered[j]);
    used[j] = true;
  }
  return errors;
}

double volume_iou(const Object& a, const Pose& T_world_a, const Object& b, const Pose& T_world_b, Rng& rng) {
  constexpr int kPoints = 20000;
  const Inside in_a(a, T_world_a), in_b(b, T_world_b);
  const BoundingBox box_a = box_around(a, T_world_a), box_b = box_around(b, T_world_b);
  const Eigen::Vector3d low = box_a.min.cwiseMin(box_b.min), high = box_a.max.cwiseMax(box_b.max);
  int both = 0, either = 0;
  for (int i = 0; i < kPoints; ++i) {
    const Eigen::Vector3d p(uniform(rng, low.x(), high.x()), uniform(rng, low.y(), high.y()),
                            uniform(rng, low.z(), high.z()));
    const bool a_holds = in_a(p), b_holds = in_b(p);
    both += a_holds && b_holds;
    either += a_holds || b_holds;
  }
  return either > 0 ? static_cast<double>(both) / either : 0.0;
}

std::vector<double> unknown_ious(const Scene& truth, const std::vector<RecoveredObject>& recovered, Rng& rng) {
  std::vector<double> ious(truth.objects.size(), 0.0);
  for (std::size_t i = 0; i < ious.size(); ++i) {
    for (const RecoveredObject& object : recovered) {
      const double apart = (truth.T_world_object[i].translation() - object.T_world_object.translation()).norm();
      if (apart > 0.5 * (truth.objects[i]->diameter + object.object->diameter)) continue;
      ious[i] = std::max(
          ious[i], volume_iou(*truth.objects[i], truth.T_world_object[i], *object.object, object.T_world_object, rng));
    }
  }
  return ious;
}

}  // namespace dofusion
