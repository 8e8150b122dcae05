// The joint choice: which objects, and where, explain a cluster of pixels together.
#pragma once

#include <vector>

#include "perception/scene_score.h"

namespace dofusion {

struct SceneSearchOptions {
  int threads = 1;
  int most_objects = 12;   // in one cluster
  int beam = 6;            // partial scenes kept where one after the other does not explain all
  int returned = 6;        // scenes
  int branches = 7;        // objects tried on each of them, at most two poses of one
  int fewest_pixels = 40;  // that stay unexplained before one more object is sought
  SceneCosts costs;
};

// Scenes that explain the cluster, the best first, no two alike, at most `returned`; the empty scene if no object
// explains anything.
std::vector<SceneHypothesis> search_scenes(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                           const SceneSearchOptions& options);

}  // namespace dofusion
