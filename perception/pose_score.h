// Render and compare: how well objects at their poses explain a depth image.
#pragma once

#include <vector>

#include "perception/camera.h"
#include "perception/depth_raster.h"
#include "perception/image.h"
#include "perception/recovery.h"
#include "perception/table.h"

namespace dofusion {

// Pixels [u0, u1) x [v0, v1), every stride-th of them.
struct PixelWindow {
  int u0 = 0, v0 = 0, u1 = 0, v1 = 0;
  int stride = 1;
};

// What the camera saw in a window.
struct Observation {
  Camera camera;  // its pixels are the window's at the stride
  Pose T_camera_world = Pose::Identity();
  DepthImage depth;           // metres, 0 = no reading
  Image<float> variance;      // sigma^2, square metres; very large without a reading
  Image<float> missing;       // 1 without a reading, else 0
  DepthImage background;      // z-depth of the bare table, a large number where the ray misses it
  double sigma = 0.0;         // metres, median of the readings' standard deviations
  float table_facing = 0.0f;  // cosine of the incidence on the table in the window's middle
  Image<float> table_cost;    // of each pixel's reading under the bare table: ViewExplanation::cost
  LabelImage labels;
};

Observation observe(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
                    const PixelWindow& window, const DepthSigma& sigma);

// Makes pixels with these labels say nothing, neither for nor against any pose.
void ignore_labels(const std::vector<std::uint8_t>& labels, Observation& observation);

// Pixels that see a scene: its z-depth and what each pixel's reading costs under it, the negative logarithm of a
// likelihood with a floor: r^2 / (2 sigma^2) with a sigma that counts the noise and, across the surface, kExactness, at
// most kNearerCost where the reading is nearer than the scene (there is something else) and kBehindCost where it is
// farther (the camera looked through the scene). No reading costs kMissingCost where the scene faces the camera and
// nothing on grazing faces, which sensors do not see. That is far less than a likelihood would say: shadows and dark
// surfaces drop out, too.
struct ViewExplanation {
  DepthImage depth;
  Image<float> cost;
};
inline constexpr float kExactness = 0.0002f;  // metres; no mesh and no pose is better
inline constexpr float kNearerCost = 6.0f;
inline constexpr float kBehindCost = 9.0f;
inline constexpr float kExplainedCost = 4.5f;  // of a reading 3 sigma off
inline constexpr float kMissingCost = 0.7f;
inline constexpr float kGrazingCosine = 0.25f;  // of the incidence: 75 degrees
inline constexpr float kFacingCosine = 0.35f;   // 70 degrees; between the two a part of kMissingCost

// One for each view of the scene.
using Explanation = std::vector<ViewExplanation>;

double total_cost(const Explanation& explanation);

// Counts of the pixels in which an object is the nearest surface of its scene.
struct PixelCounts {
  int explained = 0;  // reading within 3 sigma of the object
  int nearer = 0;     // reading in front of it: something hides it
  int behind = 0;     // reading behind it: it cannot be there
  int missing = 0;    // no reading

  PixelCounts& operator+=(const PixelCounts& other);
};

// Scores poses against the observation of one camera. Of one thread.
class ViewScorer {
 public:
  explicit ViewScorer(const Observation& observation) : observation_(&observation), raster_(observation.camera) {}

  ViewExplanation empty_scene() const;
  void add(const TriangleMesh& mesh, const Pose& T_world_object, ViewExplanation& scene);
  double gain(const ViewExplanation& scene, const TriangleMesh& mesh, const Pose& T_world_object);
  PixelCounts count(const ViewExplanation& scene, const TriangleMesh& mesh, const Pose& T_world_object);

  // The object's patch as `raster` gives it.
  const RasterPatch& render(const TriangleMesh& mesh, const Pose& T_world_object) {
    return raster_.render(mesh, observation_->T_camera_world * T_world_object);
  }
  const Observation& observation() const { return *observation_; }

 private:
  const Observation* observation_;
  DepthRaster raster_;
};

// Scores poses against what all cameras saw: costs, gains and counts are sums over the views. Of one thread.
class PoseScorer {
 public:
  explicit PoseScorer(const Observation& observation) { views_.emplace_back(observation); }
  explicit PoseScorer(const std::vector<Observation>& observations) {
    for (const Observation& observation : observations) views_.emplace_back(observation);
  }

  // The table alone.
  Explanation empty_scene() const;

  // Puts an object into the scene.
  void add(const TriangleMesh& mesh, const Pose& T_world_object, Explanation& scene);

  // By how much an object lowers the cost of the scene it is put into.
  double gain(const Explanation& scene, const TriangleMesh& mesh, const Pose& T_world_object);

  PixelCounts count(const Explanation& scene, const TriangleMesh& mesh, const Pose& T_world_object);

  // The largest sigma of the views, metres.
  double sigma() const;

  std::vector<ViewScorer>& views() { return views_; }

 private:
  std::vector<ViewScorer> views_;
};

}  // namespace dofusion
