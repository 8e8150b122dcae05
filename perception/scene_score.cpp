#include "perception/scene_score.h"

#include <algorithm>
#include <optional>

namespace dofusion {

std::vector<PlacedObject> without(std::vector<PlacedObject> objects, std::size_t i) {
  objects.erase(objects.begin() + static_cast<std::ptrdiff_t>(i));
  return objects;
}

double scene_score(const std::vector<ObjectModel>& models, const Cluster& cluster,
                   const std::vector<PlacedObject>& objects, bool complete, const SceneCosts& costs) {
  PoseScorer scorer(cluster.pyramid.fine);
  Explanation scene = scorer.empty_scene();
  double cost = 0.0;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    scorer.add(models[objects[i].model].object->mesh, objects[i].T_world_object, scene);
    const std::vector<PlacedObject> earlier(objects.begin(), objects.begin() + static_cast<std::ptrdiff_t>(i));
    cost += penetration_cost(models, objects[i], earlier, costs.penetration) + costs.object;
    if (complete) cost += floating_cost(models, objects[i], without(objects, i), costs.floating);
    if (objects[i].freedom == Freedom::kResting) cost -= costs.resting_bonus;
  }
  return -cost - total_cost(scene);
}

namespace {

// The object aligned and climbed while the others stay.
PlacedObject refined_object(const std::vector<ObjectModel>& models, PoseScorer& scorer,
                            const std::vector<PlacedObject>& others, PlacedObject object, const SceneCosts& costs) {
  const ObjectModel& model = models[object.model];
  Explanation scene = scorer.empty_scene();
  for (const PlacedObject& other : others) scorer.add(models[other.model].object->mesh, other.T_world_object, scene);
  const PoseObjective objective = [&](const Pose& pose) {
    const PlacedObject at{object.model, pose, object.freedom};
    return scorer.gain(scene, model.object->mesh, pose) - penetration_cost(models, at, others, costs.penetration) -
           floating_cost(models, at, others, costs.floating);
  };
  // At last only readings that the noise allows: others see another face, or pass the outline.
  const double noise = 3.0 * scorer.sigma();
  const AlignOptions closing{4, std::max(0.003, noise), noise + 0.0005};
  const Pose aligned =
      align_to_readings(scorer, scene, model.object->mesh, object.T_world_object, object.freedom, closing);
  ScoredPose start{object.T_world_object, objective(object.T_world_object)};
  const ScoredPose closer{aligned, objective(aligned)};
  if (closer.score > start.score) start = closer;
  object.T_world_object = climb(objective, start, object.freedom, model.radius, {0.001, 0.00025, 2}).T_world_object;
  return object;
}

}  // namespace

SceneHypothesis refine_jointly(const std::vector<ObjectModel>& models, const Cluster& cluster,
                               const SceneHypothesis& start, const SceneCosts& costs) {
  SceneHypothesis scene = start;
  scene.score = scene_score(models, cluster, scene.objects, true, costs);
  PoseScorer scorer(cluster.pyramid.fine);
  int changes = 0;
  std::vector<int> tried_at(scene.objects.size(), -1);  // after so many changes; nothing new comes of trying again then
  for (int round = 0; round < 2; ++round) {
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
      if (tried_at[i] == changes) continue;
      tried_at[i] = changes;
      const std::vector<PlacedObject> others = without(scene.objects, i);
      const auto try_from = [&](const PlacedObject& object) {
        SceneHypothesis changed = scene;
        changed.objects[i] = refined_object(models, scorer, others, object, costs);
        changed.score = scene_score(models, cluster, changed.objects, true, costs);
        if (changed.score <= scene.score) return;
        scene = changed;
        ++changes;
      };
      try_from(scene.objects[i]);
      const PlacedObject& object = scene.objects[i];
      if (object.freedom == Freedom::kResting) continue;
      const std::optional<Pose> flat =
          laid_flat(models[object.model], object.T_world_object, support_heights(models, others));
      if (flat) try_from({object.model, *flat, Freedom::kResting});
    }
  }
  return scene;
}

}  // namespace dofusion
