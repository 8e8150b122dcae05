// Pixels of a cluster that the scene so far does not account for.
#pragma once

#include <optional>

#include "perception/candidate_search.h"

namespace dofusion {

// What one camera saw of a cluster.
struct ClusterView {
  const DepthImage* depth = nullptr;
  const FaceMap* face_map = nullptr;
  Camera camera;
  Pose T_world_camera = Pose::Identity();
  PixelWindow window;                      // around its pixels, stride 1
  std::vector<std::uint8_t> other_labels;  // labels of the segmentation that belong to other clusters
};

// Everything about one cluster of objects that touch or hide each other.
struct Cluster {
  std::vector<ClusterView> views;
  ObservationPyramid pyramid;  // of the same views
};

// Pixels of the view in which they say most.
struct UnexplainedTarget {
  Target target;
  std::size_t view = 0;
};

// The largest connected group of pixels of one view and label that read nearer than the scene, or nullopt if none has
// `fewest_pixels` pixels well inside it (slivers along outlines have none). Pixels without an object's
// label join any: segmentation leaves out what is small.
std::optional<UnexplainedTarget> next_target(const Cluster& cluster, const Explanation& scene, int fewest_pixels);

}  // namespace dofusion
