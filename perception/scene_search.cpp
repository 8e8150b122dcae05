#include "perception/scene_search.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

namespace dofusion {
namespace {

constexpr double kTooFarBehind = 400.0;  // nats before refinement, for a change to be tried
constexpr double kRival = 200.0;         // nats after it, to be remembered
constexpr double kMostBehind = 0.3;      // share of a new object's readings that may lie behind it
constexpr int kRefined = 4;              // grown scenes that are refined

// Share of an object's pixels that may contradict it in a scene that needs no second look.
constexpr double kSurelyExplained = 0.03;

std::vector<Candidate> candidates_for(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                      const PyramidScene& scene, const UnexplainedTarget& target,
                                      const SceneSearchOptions& options) {
  CandidateOptions candidate_options;
  candidate_options.threads = options.threads;
  candidate_options.penetration = options.costs.penetration;
  const ClusterView& view = cluster.views[target.view];
  return find_candidates(models, cluster.pyramid, scene, target.target, view.camera, view.T_world_camera,
                         candidate_options);
}

void sort_best_first(std::vector<SceneHypothesis>& scenes) {
  std::stable_sort(scenes.begin(), scenes.end(),
                   [](const SceneHypothesis& a, const SceneHypothesis& b) { return a.score > b.score; });
}

bool alike(const std::vector<ObjectModel>& models, const SceneHypothesis& a, const SceneHypothesis& b) {
  if (a.objects.size() != b.objects.size()) return false;
  return std::all_of(a.objects.begin(), a.objects.end(), [&](const PlacedObject& p) {
    return std::any_of(b.objects.begin(), b.objects.end(), [&](const PlacedObject& q) {
      return p.model == q.model && alike(models[p.model], p.T_world_object, q.T_world_object, 0.006, 0.15);
    });
  });
}

std::vector<SceneHypothesis> distinct_scenes(const std::vector<ObjectModel>& models,
                                             std::vector<SceneHypothesis> scenes, int count) {
  sort_best_first(scenes);
  std::vector<SceneHypothesis> kept;
  for (const SceneHypothesis& scene : scenes) {
    if (static_cast<int>(kept.size()) == count) break;
    const bool seen = std::any_of(kept.begin(), kept.end(),
                                  [&](const SceneHypothesis& other) { return alike(models, scene, other); });
    if (!seen) kept.push_back(scene);
  }
  return kept;
}

// The best scenes (sorted already), no two of the same shapes: a large object that is slightly wrong explains more
// than a small one that is right, in several poses.
std::vector<SceneHypothesis> of_various_shapes(const std::vector<SceneHypothesis>& scenes, int count) {
  std::vector<SceneHypothesis> chosen;
  std::set<std::vector<int>> taken;
  for (const SceneHypothesis& scene : scenes) {
    std::vector<int> shapes;
    for (const PlacedObject& object : scene.objects) shapes.push_back(object.model);
    std::sort(shapes.begin(), shapes.end());
    if (static_cast<int>(chosen.size()) < count && taken.insert(shapes).second) chosen.push_back(scene);
  }
  return chosen;
}

// Leaves out the objects without which the scene scores better: others found later may explain their pixels.
SceneHypothesis pruned(const std::vector<ObjectModel>& models, const Cluster& cluster, SceneHypothesis scene,
                       const SceneCosts& costs) {
  for (std::size_t i = scene.objects.size(); i-- > 0;) {
    SceneHypothesis fewer{without(scene.objects, i), 0.0};
    fewer.score = scene_score(models, cluster, fewer.objects, true, costs);
    if (fewer.score > scene.score) scene = fewer;
  }
  return scene;
}

// Each object of the scene replaced by whatever else explains its place about as well or better. Returns the best
// scene and adds its rivals, which physics may prefer, to `rivals`.
SceneHypothesis improved_by_swaps(const std::vector<ObjectModel>& models, const Cluster& cluster, SceneHypothesis scene,
                                  const SceneSearchOptions& options, std::vector<SceneHypothesis>& rivals) {
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const std::vector<PlacedObject> others = without(scene.objects, i);
    const PyramidScene explained = explain(cluster.pyramid, models, others);
    const std::optional<UnexplainedTarget> target = next_target(cluster, explained.fine, options.fewest_pixels);
    if (!target) continue;
    SceneHypothesis best = scene;
    for (const Candidate& candidate : candidates_for(models, cluster, explained, *target, options)) {
      SceneHypothesis changed = scene;
      changed.objects[i] = candidate.placed;
      changed.score = scene_score(models, cluster, changed.objects, true, options.costs);
      if (changed.score < best.score - kTooFarBehind) continue;
      changed = refine_jointly(models, cluster, changed, options.costs);
      if (changed.score > best.score + 1.0) std::swap(changed, best);
      if (changed.score > best.score - kRival) rivals.push_back(changed);
    }
    scene = best;
  }
  return scene;
}

// Most of what the camera would see of it is there.
bool is_believable(const std::vector<ObjectModel>& models, const Cluster& cluster, const Explanation& scene,
                   const Candidate& candidate) {
  PoseScorer scorer(cluster.pyramid.fine);
  const PixelCounts counts =
      scorer.count(scene, models[candidate.placed.model].object->mesh, candidate.placed.T_world_object);
  return counts.behind < kMostBehind * (counts.explained + counts.behind);
}

// The scene and, one object more on each level, the scenes that contain it, `beam` of them on every level.
std::vector<SceneHypothesis> grow_scenes(const std::vector<ObjectModel>& models, const Cluster& cluster, int beam,
                                         int most_objects, const SceneSearchOptions& options) {
  std::vector<SceneHypothesis> open = {{{}, scene_score(models, cluster, {}, false, options.costs)}}, complete;
  for (int count = 0; count < most_objects && !open.empty(); ++count) {
    std::vector<SceneHypothesis> next;
    for (const SceneHypothesis& scene : open) {
      const PyramidScene explained = explain(cluster.pyramid, models, scene.objects);
      const std::optional<UnexplainedTarget> target = next_target(cluster, explained.fine, options.fewest_pixels);
      complete.push_back(scene);
      if (!target) continue;
      const std::vector<Candidate> candidates = candidates_for(models, cluster, explained, *target, options);
      std::vector<int> branches_of(models.size(), 0);
      int branches = 0;
      for (const Candidate& candidate : candidates) {
        if (candidate.gain < options.costs.object || branches == options.branches) break;
        if (++branches_of[candidate.placed.model] > 2 || !is_believable(models, cluster, explained.fine, candidate)) {
          continue;
        }
        SceneHypothesis larger = scene;
        larger.objects.push_back(candidate.placed);
        larger.score = scene_score(models, cluster, larger.objects, false, options.costs);
        next.push_back(larger);
        ++branches;
      }
    }
    sort_best_first(next);
    open = of_various_shapes(next, beam);
    complete.insert(complete.end(), next.begin(), next.end());
    // What an inexact pose leaves unexplained must not call for another object.
    for (SceneHypothesis& scene : open) scene = refine_jointly(models, cluster, scene, options.costs);
  }
  complete.insert(complete.end(), open.begin(), open.end());
  complete = distinct_scenes(models, std::move(complete), kRefined);
  for (SceneHypothesis& scene : complete) {
    scene = pruned(models, cluster, refine_jointly(models, cluster, scene, options.costs), options.costs);
  }
  sort_best_first(complete);
  return complete;
}

// Nothing is left over, and nearly every pixel reads what the scene says.
bool explains_all(const std::vector<ObjectModel>& models, const Cluster& cluster, const SceneHypothesis& scene,
                  const SceneSearchOptions& options) {
  PoseScorer scorer(cluster.pyramid.fine);
  if (next_target(cluster, explain(cluster.pyramid, models, scene.objects).fine, options.fewest_pixels)) return false;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    Explanation others = scorer.empty_scene();
    for (const PlacedObject& other : without(scene.objects, i)) {
      scorer.add(models[other.model].object->mesh, other.T_world_object, others);
    }
    const PlacedObject& object = scene.objects[i];
    const PixelCounts counts = scorer.count(others, models[object.model].object->mesh, object.T_world_object);
    if (counts.nearer + counts.behind > kSurelyExplained * counts.explained) return false;
  }
  return true;
}

}  // namespace

std::vector<SceneHypothesis> search_scenes(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                           const SceneSearchOptions& options) {
  // Object by object first. Only where that leaves something open are several partial scenes followed.
  std::vector<SceneHypothesis> scenes = grow_scenes(models, cluster, 1, options.most_objects, options);
  const auto improve_front = [&](std::vector<SceneHypothesis>& grown) {
    if (grown.front().objects.size() < 2) return;
    std::vector<SceneHypothesis> rivals;
    grown.push_back(improved_by_swaps(models, cluster, grown.front(), options, rivals));
    grown.insert(grown.end(), rivals.begin(), rivals.end());
    sort_best_first(grown);
  };
  improve_front(scenes);
  if (options.beam > 1 && !scenes.front().objects.empty() && !explains_all(models, cluster, scenes.front(), options)) {
    const int count = static_cast<int>(scenes.front().objects.size());
    std::vector<SceneHypothesis> more = grow_scenes(models, cluster, options.beam, count + 1, options);
    if (more.front().score > scenes.front().score) improve_front(more);
    scenes.insert(scenes.end(), more.begin(), more.end());
  }
  for (SceneHypothesis& scene : scenes) scene = pruned(models, cluster, scene, options.costs);
  return distinct_scenes(models, std::move(scenes), options.returned);
}

}  // namespace dofusion
