#include "perception/scene_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace dofusion {
namespace {

// In nats: what a resting object may lose against one of free pose and still be preferred.
constexpr double kRestingBonus = 15.0;

double squared(double x) { return x * x; }

std::vector<PlacedObject> without(std::vector<PlacedObject> objects, std::size_t i) {
  objects.erase(objects.begin() + static_cast<std::ptrdiff_t>(i));
  return objects;
}

// Overlap of one object with the others and with the table, in nats.
double penetration_cost(const std::vector<ObjectModel>& models, const PlacedObject& object,
                        const std::vector<PlacedObject>& others, double sigma) {
  const ObjectModel& model = models[object.model];
  double cost = 0.5 * squared(std::min(0.0, lowest_point(model, object.T_world_object)) / sigma);
  for (const PlacedObject& other : others) {
    const double gap = clearance(model, object.T_world_object, models[other.model], other.T_world_object);
    cost += 0.5 * squared(std::min(0.0, gap) / sigma);
  }
  return cost;
}

double floating_cost(const std::vector<ObjectModel>& models, const PlacedObject& object,
                     const std::vector<PlacedObject>& others, double sigma) {
  double gap = lowest_point(models[object.model], object.T_world_object);
  for (const PlacedObject& other : others) {
    gap = std::min(gap, clearance(models[object.model], object.T_world_object, models[other.model],
                                  other.T_world_object));
  }
  return std::min(300.0, 0.5 * squared(std::max(0.0, gap) / sigma));
}

// Level surfaces to rest on: the table and the flat tops of objects.
std::vector<double> support_heights(const std::vector<ObjectModel>& models,
                                    const std::vector<PlacedObject>& objects) {
  std::vector<double> heights = {0.0};
  for (const PlacedObject& object : objects) {
    for (const PlanarFace& face : models[object.model].faces) {
      if ((object.T_world_object.linear() * face.normal).z() > 0.9995) {
        heights.push_back((object.T_world_object * face.centroid).z());
      }
    }
  }
  return heights;
}

class PixelGroups {
 public:
  PixelGroups(const Cluster& cluster, const Explanation& scene) : cluster_(cluster), scene_(scene) {
    const Observation& seen = cluster.pyramid.fine;
    open_ = Image<std::uint8_t>(seen.depth.width, seen.depth.height, 0);
    for (int v = 0; v < open_.height; ++v) {
      for (int u = 0; u < open_.width; ++u) open_.at(v, u) = is_unexplained(v, u);
    }
  }

  // Connected unexplained pixels with one label, as indices into the full image; the largest group.
  std::vector<int> largest() {
    std::vector<int> best;
    int most = 0;
    for (int v = 0; v < open_.height; ++v) {
      for (int u = 0; u < open_.width; ++u) {
        if (!open_.at(v, u)) continue;
        int core = 0;
        std::vector<int> group = flood(v, u, &core);
        if (core <= most) continue;
        most = core;
        best = std::move(group);
      }
    }
    core_of_largest_ = most;
    return best;
  }

  // Its pixels that lie well inside: slivers along outlines have none.
  int core_of_largest() const { return core_of_largest_; }

 private:
  bool is_unexplained(int v, int u) const {
    const Observation& seen = cluster_.pyramid.fine;
    const std::uint8_t label = seen.labels.at(v, u);
    const bool own = std::find(cluster_.own_labels.begin(), cluster_.own_labels.end(), label) !=
                     cluster_.own_labels.end();
    return own && seen.depth.at(v, u) > 0.0f && seen.depth.at(v, u) < scene_.depth.at(v, u) &&
           scene_.cost.at(v, u) >= 0.99f * kNearerCost;
  }

  int open_neighbours(int v, int u) const {
    int count = 0;
    for (int dv = -1; dv <= 1; ++dv) {
      for (int du = -1; du <= 1; ++du) {
        if ((dv != 0 || du != 0) && open_.contains(v + dv, u + du) && open_.at(v + dv, u + du) != 0) ++count;
      }
    }
    return count;
  }

  std::vector<int> flood(int v0, int u0, int* core) {
    const LabelImage& labels = cluster_.pyramid.fine.labels;
    std::vector<int> group;
    std::vector<std::pair<int, int>> stack = {{v0, u0}};
    std::vector<std::pair<int, int>> members;
    open_.at(v0, u0) = 2;
    while (!stack.empty()) {
      const auto [v, u] = stack.back();
      stack.pop_back();
      members.emplace_back(v, u);
      if (open_neighbours(v, u) >= 4) ++*core;
      for (int dv = -2; dv <= 2; ++dv) {
        for (int du = -2; du <= 2; ++du) {  // over gaps of one pixel: drop-outs
          if (!open_.contains(v + dv, u + du) || open_.at(v + dv, u + du) != 1) continue;
          if (labels.at(v + dv, u + du) != labels.at(v0, u0)) continue;
          open_.at(v + dv, u + du) = 2;
          stack.emplace_back(v + dv, u + du);
        }
      }
    }
    for (const auto& [v, u] : members) {
      group.push_back((cluster_.window.v0 + v) * cluster_.depth->width + cluster_.window.u0 + u);
      open_.at(v, u) = 0;
    }
    return group;
  }

  const Cluster& cluster_;
  const Explanation& scene_;
  Image<std::uint8_t> open_;
  int core_of_largest_ = 0;
};

// What still needs an object, or nullopt if the scene is complete.
std::optional<Target> next_target(const Cluster& cluster, const Explanation& scene,
                                  const SceneSearchOptions& options) {
  PixelGroups groups(cluster, scene);
  const std::vector<int> pixels = groups.largest();
  if (groups.core_of_largest() < options.fewest_pixels) return std::nullopt;
  return make_target(pixels, *cluster.depth, cluster.camera, cluster.T_world_camera, *cluster.face_map);
}

std::vector<Candidate> candidates_for(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                      const std::vector<PlacedObject>& objects, const PyramidScene& scene,
                                      const Target& target, const SceneSearchOptions& options) {
  CandidateOptions candidate_options;
  candidate_options.threads = options.threads;
  return find_candidates(models, cluster.pyramid, scene, target, cluster.camera, cluster.T_world_camera,
                         support_heights(models, objects), candidate_options);
}

void sort_and_cut(std::vector<SceneHypothesis>& scenes, int count) {
  std::stable_sort(scenes.begin(), scenes.end(),
                   [](const SceneHypothesis& a, const SceneHypothesis& b) { return a.score > b.score; });
  if (static_cast<int>(scenes.size()) > count) scenes.resize(count);
}

// The pose laid flat if it lies nearly flat on one of the level surfaces.
std::optional<Pose> laid_flat(const ObjectModel& model, const Pose& pose, const std::vector<double>& heights) {
  constexpr double kTilt = 0.07, kGap = 0.004;  // radians, metres
  const double lowest = lowest_point(model, pose);
  for (const DistinctRest& rest : model.resting) {
    for (const Eigen::Matrix3d& symmetry : model.symmetries) {
      // The direction in the object's frame that points down when it rests so.
      const Eigen::Vector3d down = symmetry * (rest.pose.R_world_object.transpose() * -Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d down_world = pose.linear() * down;
      if (down_world.z() > -std::cos(kTilt)) continue;
      for (const double height : heights) {
        if (std::abs(lowest - height) > kGap) continue;
        const Eigen::Matrix3d upright =
            Eigen::Quaterniond::FromTwoVectors(down_world, -Eigen::Vector3d::UnitZ()).toRotationMatrix();
        Eigen::Vector3d t = pose.translation();
        t.z() = height + rest.pose.height;
        return make_pose(upright * pose.linear(), t);
      }
    }
  }
  return std::nullopt;
}

// One object of the scene replaced by whatever explains its place better.
bool improve_by_swap(const std::vector<ObjectModel>& models, const Cluster& cluster, SceneHypothesis& scene,
                     const SceneSearchOptions& options) {
  bool improved = false;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const std::vector<PlacedObject> others = without(scene.objects, i);
    const PyramidScene explained = explain(cluster.pyramid, models, others);
    const std::optional<Target> target = next_target(cluster, explained.fine, options);
    if (!target) continue;
    SceneHypothesis best = scene;
    for (const Candidate& candidate : candidates_for(models, cluster, others, explained, *target, options)) {
      SceneHypothesis changed = scene;
      changed.objects[i] = candidate.placed;
      changed.score = scene_score(models, cluster, changed.objects, true, options);
      if (changed.score < best.score - 400.0) continue;  // too far behind for refinement to help
      changed = refine_jointly(models, cluster, changed, options);
      if (changed.score > best.score + 1.0) best = changed;
    }
    if (best.score > scene.score) {
      scene = best;
      improved = true;
    }
  }
  return improved;
}

}  // namespace

double scene_score(const std::vector<ObjectModel>& models, const Cluster& cluster,
                   const std::vector<PlacedObject>& objects, bool complete, const SceneSearchOptions& options) {
  PoseScorer scorer(cluster.pyramid.fine);
  Explanation scene = scorer.empty_scene();
  double cost = 0.0;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    scorer.add(models[objects[i].model].object->mesh, objects[i].T_world_object, scene);
    const std::vector<PlacedObject> earlier(objects.begin(), objects.begin() + static_cast<std::ptrdiff_t>(i));
    cost += penetration_cost(models, objects[i], earlier, options.penetration) + options.object_cost;
    if (complete) cost += floating_cost(models, objects[i], without(objects, i), options.floating);
    if (objects[i].freedom == Freedom::kResting) cost -= kRestingBonus;
  }
  return -cost - total_cost(scene);
}

SceneHypothesis refine_jointly(const std::vector<ObjectModel>& models, const Cluster& cluster,
                               const SceneHypothesis& start, const SceneSearchOptions& options) {
  SceneHypothesis scene = start;
  scene.score = scene_score(models, cluster, scene.objects, true, options);
  PoseScorer scorer(cluster.pyramid.fine);
  for (int round = 0; round < 2; ++round) {
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
      const std::vector<PlacedObject> others = without(scene.objects, i);
      Explanation rest_of_scene = scorer.empty_scene();
      for (const PlacedObject& other : others) {
        scorer.add(models[other.model].object->mesh, other.T_world_object, rest_of_scene);
      }
      const ObjectModel& model = models[scene.objects[i].model];
      const auto try_from = [&](PlacedObject object) {
        const PoseObjective objective = [&](const Pose& pose) {
          PlacedObject at = object;
          at.T_world_object = pose;
          return scorer.gain(rest_of_scene, model.object->mesh, pose) -
                 penetration_cost(models, at, others, options.penetration) -
                 floating_cost(models, at, others, options.floating);
        };
        const Pose aligned = align_to_readings(scorer, rest_of_scene, model.object->mesh, object.T_world_object,
                                               object.freedom, {2, 0.006, 0.006});
        if (objective(aligned) > objective(object.T_world_object)) object.T_world_object = aligned;
        object.T_world_object =
            climb(objective, object.T_world_object, object.freedom, model.radius, {0.001, 0.00025, 2}).T_world_object;
        SceneHypothesis changed = scene;
        changed.objects[i] = object;
        changed.score = scene_score(models, cluster, changed.objects, true, options);
        if (changed.score > scene.score) scene = changed;
      };
      try_from(scene.objects[i]);
      if (scene.objects[i].freedom == Freedom::kResting) continue;
      const std::optional<Pose> flat =
          laid_flat(model, scene.objects[i].T_world_object, support_heights(models, others));
      if (flat) try_from({scene.objects[i].model, *flat, Freedom::kResting});
    }
  }
  return scene;
}

std::vector<SceneHypothesis> search_scenes(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                           const SceneSearchOptions& options) {
  std::vector<SceneHypothesis> open = {{{}, scene_score(models, cluster, {}, false, options)}}, complete;
  for (int count = 0; count < options.most_objects && !open.empty(); ++count) {
    std::vector<SceneHypothesis> next;
    for (const SceneHypothesis& scene : open) {
      const PyramidScene explained = explain(cluster.pyramid, models, scene.objects);
      const std::optional<Target> target = next_target(cluster, explained.fine, options);
      int grown = 0;
      if (target) {
        for (const Candidate& candidate :
             candidates_for(models, cluster, scene.objects, explained, *target, options)) {
          if (grown == options.branches || candidate.gain < options.object_cost) break;
          SceneHypothesis larger = scene;
          larger.objects.push_back(candidate.placed);
          larger.score = scene_score(models, cluster, larger.objects, false, options);
          next.push_back(larger);
          ++grown;
        }
      }
      if (grown == 0) complete.push_back(scene);
    }
    sort_and_cut(next, options.beam);
    open = std::move(next);
  }
  complete.insert(complete.end(), open.begin(), open.end());
  sort_and_cut(complete, options.beam);
  for (SceneHypothesis& scene : complete) scene = refine_jointly(models, cluster, scene, options);
  sort_and_cut(complete, options.beam);
  if (complete.front().objects.size() > 1) improve_by_swap(models, cluster, complete.front(), options);
  sort_and_cut(complete, options.beam);
  return complete;
}

}  // namespace dofusion
