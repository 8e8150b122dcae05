#include "perception/scene_search.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace dofusion {
namespace {

constexpr double kTooFarBehind = 400.0;  // nats before refinement, for a change to be tried
constexpr double kRival = 200.0;         // nats after it, to be remembered

// Share of an object's pixels that may contradict it in a scene that needs no second look.
constexpr double kSurelyExplained = 0.03;

std::vector<Candidate> candidates_for(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                      const PyramidScene& scene, const Target& target,
                                      const SceneSearchOptions& options) {
  CandidateOptions candidate_options;
  candidate_options.threads = options.threads;
  candidate_options.penetration = options.costs.penetration;
  return find_candidates(models, cluster.pyramid, scene, target, cluster.camera, cluster.T_world_camera,
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

// Each object of the scene replaced by whatever else explains its place about as well or better. Returns the best
// scene and adds its rivals, which physics may prefer, to `rivals`.
SceneHypothesis improved_by_swaps(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                  SceneHypothesis scene, const SceneSearchOptions& options,
                                  std::vector<SceneHypothesis>& rivals) {
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const std::vector<PlacedObject> others = without(scene.objects, i);
    const PyramidScene explained = explain(cluster.pyramid, models, others);
    const std::optional<Target> target = next_target(cluster, explained.fine, options.fewest_pixels);
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

// The scene and, one object more on each level, the scenes that contain it, `beam` of them on every level.
std::vector<SceneHypothesis> grow_scenes(const std::vector<ObjectModel>& models, const Cluster& cluster, int beam,
                                         const SceneSearchOptions& options) {
  std::vector<SceneHypothesis> open = {{{}, scene_score(models, cluster, {}, false, options.costs)}}, complete;
  for (int count = 0; count < options.most_objects && !open.empty(); ++count) {
    std::vector<SceneHypothesis> next;
    for (const SceneHypothesis& scene : open) {
      const PyramidScene explained = explain(cluster.pyramid, models, scene.objects);
      const std::optional<Target> target = next_target(cluster, explained.fine, options.fewest_pixels);
      complete.push_back(scene);
      if (!target) continue;
      const std::vector<Candidate> candidates = candidates_for(models, cluster, explained, *target, options);
      for (std::size_t i = 0; i < candidates.size() && static_cast<int>(i) < options.branches; ++i) {
        if (candidates[i].gain < options.costs.object) break;
        SceneHypothesis larger = scene;
        larger.objects.push_back(candidates[i].placed);
        larger.score = scene_score(models, cluster, larger.objects, false, options.costs);
        next.push_back(larger);
      }
    }
    sort_best_first(next);
    open.assign(next.begin(), next.begin() + std::min<std::ptrdiff_t>(beam, next.size()));
    complete.insert(complete.end(), next.begin() + open.size(), next.end());
  }
  complete.insert(complete.end(), open.begin(), open.end());
  sort_best_first(complete);
  complete.resize(std::min<std::size_t>(complete.size(), options.beam));
  for (SceneHypothesis& scene : complete) scene = refine_jointly(models, cluster, scene, options.costs);
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
  std::vector<SceneHypothesis> scenes = grow_scenes(models, cluster, 1, options);
  if (scenes.front().objects.size() > 1) {
    scenes.front() = improved_by_swaps(models, cluster, scenes.front(), options, scenes);
  }
  sort_best_first(scenes);
  if (options.beam > 1 && !explains_all(models, cluster, scenes.front(), options)) {
    std::vector<SceneHypothesis> more = grow_scenes(models, cluster, options.beam, options);
    if (more.front().objects.size() > 1) more.front() = improved_by_swaps(models, cluster, more.front(), options, more);
    scenes.insert(scenes.end(), more.begin(), more.end());
  }
  return distinct_scenes(models, std::move(scenes), options.returned);
}

}  // namespace dofusion
