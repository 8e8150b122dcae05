// Synthetic scenes seen by depth cameras, and how far what is recovered from them is off.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "perception/recovery.h"
#include "perception/synthetic_view.h"
#include "perception/views.h"
#include "stability/random.h"

namespace dofusion {

enum class TrialShapes { kBlocks, kBlocksAndBoxes };  // the seven blocks; every other scene of boxes of random size

struct TrialOptions {
  TrialShapes shapes = TrialShapes::kBlocks;
  int objects = 0;  // 1 … 3; 0: scenes of one object, two and three touching, two and three stacked in turn
  int views = 1;
  SyntheticViewOptions viewing;
  std::uint64_t seed = 0;
};

struct Trial {
  std::string kind;  // "1", "2 touching", "3 stacked", …
  Scene truth;
  std::vector<SyntheticView> seen;
  std::vector<double> visible_share;  // of each object: of its silhouette's pixels, in the view that shows most of it
};

// Trial `index` depends on options and index alone; its first views do not depend on how many there are.
Trial make_trial(const TrialOptions& options, int index);

// What the cameras know: depth and their poses in the first camera's frame.
std::vector<View> views_of(const Trial& trial, int count);

struct ObjectError {
  bool matched = false, right_shape = false;
  double translation = 0.0;  // metres
  double angle = 0.0;        // radians, the least over the shape's symmetries
};

// Each true object's error; recovered objects (their poses in the true world) go to the nearest true ones, one to one,
// within 5 cm.
std::vector<ObjectError> known_errors(const Scene& truth, const std::vector<RecoveredObject>& recovered);

// Monte Carlo, 20,000 points over the box around both; any closed meshes.
double volume_iou(const Object& a, const Pose& T_world_a, const Object& b, const Pose& T_world_b, Rng& rng);

// Each true object's IoU with the recovered one that overlaps it most, 0 if none does.
std::vector<double> unknown_ious(const Scene& truth, const std::vector<RecoveredObject>& recovered, Rng& rng);

}  // namespace dofusion
