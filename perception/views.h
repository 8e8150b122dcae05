// Several depth images of one scene, taken from known places.
#pragma once

#include <optional>
#include <vector>

#include "perception/camera.h"
#include "perception/image.h"
#include "perception/segmentation.h"
#include "perception/table.h"

namespace dofusion {

// One camera's image. `T_world_camera` is given in any frame that all views share (a robot's base, the first camera);
// on_common_table() changes that to the table's.
struct View {
  DepthImage depth;  // z-depth, metres, of the camera's size
  Camera camera;
  Pose T_world_camera = Pose::Identity();
  LabelImage labels;  // as `segment` gives them; empty until then
};

// The view as a table seen by one camera, in the views' common world.
Table table_of(const View& view);

// The views with their world on the table that all of them see: z up, the table at z = 0, origin and x axis as the
// first view gives them (see Table). Each view's plane is found by itself, and one plane is fitted to the readings of
// all planes that agree with the one most views share (to 3 cm where the cameras look and 5 degrees). nullopt if no
// view shows a table. Throws std::invalid_argument if there is no view or an image is not of its camera's size.
std::optional<std::vector<View>> on_common_table(std::vector<View> views, const TableOptions& options = {});

// Segments every view by itself. `T_world_camera` must be that of on_common_table().
void segment_views(std::vector<View>& views, const SegmentationOptions& options = {});

struct LabelFusionOptions {
  double min_share = 0.2;  // of a label's readings that must lie in the other view's object (or the other way round)
  double margin = 0.004;   // metres around an object's hull that count as in it
  int most_points = 400;   // of a label in a view that are compared
};

// Gives one label to what is one object in all views: labels are associated where the readings of one view lie inside
// the hull of the other view's readings. The view with the median number of objects comes first; a label that covers
// several objects of the views before is parted between them, several labels in one object are joined, and what the
// views before have not seen gets a new label (at most 254 objects).
void fuse_labels(std::vector<View>& views, const LabelFusionOptions& options = {});

}  // namespace dofusion
