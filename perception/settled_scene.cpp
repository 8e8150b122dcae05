#include "perception/settled_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stability/physics.h"

namespace dofusion {
namespace {

constexpr double kFallsOver = 150.0;    // nats: handicap of a scene that does not stand
constexpr double kSettlingGain = 50.0;  // nats that settling may at most be hoped to win
constexpr double kTimeLimit = 1.0;      // simulated seconds; what has hardly moved by then stands
constexpr double kWorsePerPixel = 0.1;  // nats that settling may cost for each pixel an object shows

int visible_pixels(const std::vector<ObjectModel>& models, const Cluster& cluster,
                   const std::vector<PlacedObject>& objects) {
  PoseScorer scorer(cluster.pyramid.fine);
  const Explanation empty = scorer.empty_scene();
  int sum = 0;
  for (const PlacedObject& object : objects) {
    sum += scorer.count(empty, models[object.model].object->mesh, object.T_world_object).explained;
  }
  return sum;
}

struct Settled {
  SceneHypothesis scene;
  bool stands = false;
};

Settled settle(const std::vector<ObjectModel>& models, const Cluster& cluster, const SceneHypothesis& scene,
               const SceneCosts& costs, const SettleLimits& limits) {
  std::vector<ObjectPtr> objects;
  std::vector<Pose> poses;
  for (const PlacedObject& object : scene.objects) {
    objects.push_back(models[object.model].object);
    poses.push_back(object.T_world_object);
  }
  PhysicsOptions physics;
  physics.time_limit = kTimeLimit;
  const SettleResult result = Simulator(objects, physics).settle(poses);
  Settled settled{scene, result.status != SettleStatus::kDiverged};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose moved_by = poses[i].inverse() * result.T_world_object[i];
    if (moved_by.translation().norm() > limits.distance || rotation_angle(moved_by.linear()) > limits.angle) {
      settled.stands = false;
    }
    settled.scene.objects[i].T_world_object = result.T_world_object[i];
  }
  settled.scene.score = scene_score(models, cluster, settled.scene.objects, true, costs);
  return settled;
}

}  // namespace

SceneHypothesis choose_settled(const std::vector<ObjectModel>& models, const Cluster& cluster,
                               const std::vector<SceneHypothesis>& scenes, const SceneCosts& costs,
                               const SettleLimits& limits) {
  SceneHypothesis best = scenes.front();
  double best_score = -std::numeric_limits<double>::infinity();
  for (const SceneHypothesis& seen : scenes) {
    if (seen.objects.empty() || seen.score < best_score - kSettlingGain) continue;
    const double allowed = kWorsePerPixel * visible_pixels(models, cluster, seen.objects);
    Settled settled = settle(models, cluster, seen, costs, limits);
    if (settled.stands) {
      // Physics leads out of the small local optima of the image; what it finds is worth another look.
      const SceneHypothesis again = refine_jointly(models, cluster, settled.scene, costs);
      const Settled resettled = settle(models, cluster, again, costs, limits);
      if (resettled.stands && resettled.scene.score > settled.scene.score) settled = resettled;
    }
    const bool accept = settled.stands && settled.scene.score >= seen.score - allowed;
    // Of scenes that look alike the settled poses tell more: the wrong shapes must move to stand.
    const double score = accept ? settled.scene.score : seen.score - kFallsOver;
    if (score <= best_score) continue;
    best_score = score;
    best = accept ? settled.scene : seen;
  }
  return best;
}

}  // namespace dofusion
