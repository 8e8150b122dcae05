// The joint choice: which objects, and where, explain a cluster of pixels together.
#pragma once

#include <vector>

#include "perception/candidate_search.h"

namespace dofusion {

// Everything about one cluster of objects that touch or hide each other.
struct Cluster {
  const DepthImage* depth = nullptr;
  const LabelImage* labels = nullptr;
  const FaceMap* face_map = nullptr;
  Camera camera;
  Pose T_world_camera = Pose::Identity();
  PixelWindow window;                      // around its pixels, stride 1
  std::vector<std::uint8_t> own_labels;    // labels of the segmentation that belong to it
  ObservationPyramid pyramid;
};

struct SceneSearchOptions {
  int threads = 1;
  int most_objects = 12;       // in one cluster
  int beam = 3;                // partial scenes kept
  int branches = 4;            // objects tried on each of them
  int fewest_pixels = 40;      // that stay unexplained before one more object is sought
  double object_cost = 100.0;  // what one more object must gain
  double penetration = 0.0005; // metres that objects are expected to overlap by at most (one sigma)
  double floating = 0.001;     // metres between an object and what it should rest on (one sigma)
};

struct SceneHypothesis {
  std::vector<PlacedObject> objects;
  double score = 0.0;  // minus the cost of all pixels, of the objects and of what is physically wrong
};

// Scenes that explain the cluster, the best first, at most `beam`; the empty scene if no object explains anything.
std::vector<SceneHypothesis> search_scenes(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                           const SceneSearchOptions& options);

// The score of a scene; `complete` scenes are charged for objects that hang in the air, too.
double scene_score(const std::vector<ObjectModel>& models, const Cluster& cluster,
                   const std::vector<PlacedObject>& objects, bool complete, const SceneSearchOptions& options);

// Every object in turn aligned and climbed while the others stay.
SceneHypothesis refine_jointly(const std::vector<ObjectModel>& models, const Cluster& cluster,
                               const SceneHypothesis& scene, const SceneSearchOptions& options);

}  // namespace dofusion
