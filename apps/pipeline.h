// Depth image -> scene: the steps that dofusion-place and dofusion-study share.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "perception/recovery.h"
#include "perception/segmentation.h"
#include "perception/views.h"
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
  std::vector<View> views;                 // as given and segmented, on the table: its world is theirs
  LabelImage labels;                       // 0 nothing, 1 table, 2 + i objects[i]
  std::vector<RecoveredObject> objects;    // at the poses of `scene`
  std::vector<std::vector<float>> seen;    // of unknown objects: shares of the mesh's triangles (seen_surface.h)
  Scene scene;                             // physically plausible: everything rests
  SettleStatus settled = SettleStatus::kSettled;
  double moved_pct = 0.0;                  // how far the recovered objects moved to come to rest, of their diameters
  double moved_deg = 0.0;
  std::map<std::string, double> timing_ms; // "segment", "recover"
};

// Table, segmentation, recovery of every object, and the least motion that makes the scene stand.
RecoveredScene recover_scene(const DepthImage& depth, const Camera& camera, const SceneRecoveryOptions& options);

// The same from several views, whose T_world_camera are in any frame that they share (perception/views.h). The table's
// camera, the labels and the pixels are the first view's. Throws std::invalid_argument if there is no view, or a mask
// but several views.
RecoveredScene recover_scene(const std::vector<View>& views, const SceneRecoveryOptions& options);

}  // namespace dofusion
