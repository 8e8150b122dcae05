// Depth image -> scene: the steps that dofusion-place and dofusion-study share.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "perception/recovery.h"
#include "perception/segmentation.h"
#include "stability/physics.h"

namespace dofusion {

struct SceneRecoveryOptions {
  std::vector<ObjectPtr> library;   // the objects on the table are among these; empty: nothing is known of them
  std::optional<LabelImage> mask;   // a user's segmentation in place of our own
  PhysicsOptions physics;
  int threads = 1;
};

struct RecoveredScene {
  std::optional<Table> table;              // none: no table was found, and nothing else is set
  LabelImage labels;                       // 0 nothing, 1 table, 2 + i objects[i]
  std::vector<RecoveredObject> objects;    // at the poses of `scene`
  Scene scene;                             // physically plausible: everything rests
  SettleStatus settled = SettleStatus::kSettled;
  double moved_pct = 0.0;                  // how far the recovered objects moved to come to rest, of their diameters
  double moved_deg = 0.0;
  std::map<std::string, double> timing_ms; // "segment", "recover"
};

// Table, segmentation, recovery of every object, and the least motion that makes the scene stand.
RecoveredScene recover_scene(const DepthImage& depth, const Camera& camera, const SceneRecoveryOptions& options);

}  // namespace dofusion
