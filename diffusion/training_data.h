// Training examples drawn from datasets of stable scenes. First the number of objects is drawn, each that there is with
// a probability proportional to itself: crowded scenes are the hard ones, and often the fewest. Then a scene of so many;
// a random object, of a stack its top, becomes the query, the scene is turned by a random yaw (and mirrored where the
// shapes allow it), the query's pose gets noise.
//
// With ModelConfig::perception_noise s > 0 the other objects are shown as a camera might have them: each is shifted by
// N(0, s) normalised lengths along each axis, turned by a rotation vector of N(0, s) radians, and stretched along each
// of its own axes by exp(N(0, s)). The query's true pose, in the true scene, stays the target.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "diffusion/augmented_cloud.h"
#include "diffusion/config.h"
#include "diffusion/network.h"
#include "stability/dataset.h"
#include "stability/shape_symmetry.h"

namespace dofusion {

class TrainingSet {
 public:
  // Throws InputError if there is no scene, or if a pose is not finite. Which scenes: DatasetFilter says it when the
  // datasets are read.
  TrainingSet(std::vector<SceneDataset> datasets, const ModelConfig& config);

  std::size_t scenes() const { return scenes_.size(); }

  // Example number `example` of the endless sequence that `seed` gives, appended to a batch and its targets.
  void append(std::uint64_t seed, std::uint64_t example, NetworkInput& batch, std::vector<float>& target) const;

 private:
  struct Shape {
    ObjectPtr object;      // at scale 1
    bool mirrors = false;  // its own mirror image in y
    ShapeSymmetry symmetry;  // of config.equivalent
  };
  struct TrainingScene {
    std::vector<SceneObject> objects;  // with indices into shapes_
    bool stack = false;                // the last object is the only query
  };
  CloudShapePtr cloud_shape(const Shape& shape, const Eigen::Vector3d& scale) const;
  void perceive(const SceneObject& object, double length, Rng& rng, CloudShapePtr& shape, Pose& pose) const;
  Pose nearest_equivalent(const Shape& shape, const Eigen::Vector3d& scale, const Pose& clean, const Pose& noisy) const;

  ModelConfig config_;
  std::vector<Shape> shapes_;
  const TrainingScene& draw_scene(Rng& rng) const;

  std::vector<TrainingScene> scenes_;          // by number of objects
  std::vector<std::pair<int, int>> by_count_;  // begin and end in scenes_ of those of one number of objects
  int weight_ = 0;                             // sum of those numbers
};

// One example's network input: the cloud of the scene with the query at its noisy pose, and pose features. `origin`:
// where the paper's preset has its world origin (the default preset's is at the noisy query).
void append_input(const ModelConfig& config, const std::vector<CloudShapePtr>& shapes,
                  const std::vector<Pose>& T_world_object, int query, double length, double sigma,
                  const Eigen::Vector2d& origin, int points, Rng& rng, NetworkInput& batch);

}  // namespace dofusion
