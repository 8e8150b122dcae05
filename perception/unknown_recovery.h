// Solid shapes for objects of which nothing is known.
#pragma once

#include <vector>

#include "perception/recovery.h"
#include "perception/segmentation.h"
#include "perception/shape_fit.h"
#include "perception/views.h"

namespace dofusion {

struct UnknownRecoveryOptions {
  DepthSigma sigma;            // of the depth readings
  bool calibrate = true;       // take `sigma` and `warp` from the scatter of the table's readings
  double warp = 0.0;           // sigmas by which the sensor bends planes
  int min_pixels = 30;         // with a reading; labels with fewer are left out
  double min_size = 0.004;     // metres; an object is at least this high
  double contact = 0.01;       // metres, with three sigmas: how deep an object's visible foot may lie below the top
                               // of what it stands on
  double rests_on = 0.08;      // share of an object's readings that must lie above what it stands on
  double balance = 0.004;      // metres; a centre of mass lies at least this far inside what carries it
  double max_extension = 0.3;  // metres that a carrying object may be larger than seen, where that is hidden
  double overlap = 5e-4;       // metres; neighbours that overlap deeper are cut apart
  ShapeFitOptions shape;
  FaceOptions faces;  // its sigma is set from the one above
};

// For each label from 2 up a closed convex mesh that shows what is seen of the object and reaches down to the table or
// to the object that it stands on. Objects are cut where they would overlap. Labels without enough readings, or whose
// readings span no volume above their support, are left out; an image without objects gives an empty list. `score`
// is the share of the object's readings that the mesh explains, less that which it contradicts. Of an object that the
// image's border cuts, the part inside counts. Readings that are not finite or not positive count as none. Throws
// std::invalid_argument if an image is not of the camera's size or the camera's focal lengths are not positive.
std::vector<RecoveredObject> recover_unknown(const DepthImage& depth, const Camera& camera, const Table& table,
                                             const LabelImage& labels, const UnknownRecoveryOptions& options = {});

// The same from several views of one scene together: an object is what the readings of all views show, and what any
// view sees behind it is proven empty. The views' world comes from on_common_table(), their labels need not agree
// (fuse_labels() is applied to them). `label` and `pixels` are those of the first view, 0 if it does not show the
// object. Throws std::invalid_argument as above, and without any view.
std::vector<RecoveredObject> recover_unknown(const std::vector<View>& views,
                                             const UnknownRecoveryOptions& options = {});

// The recovered objects as a scene.
Scene to_scene(const std::vector<RecoveredObject>& objects);

}  // namespace dofusion
