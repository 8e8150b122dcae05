// Which objects of a library stand on the table, and where: recovery with known shapes.
#pragma once

#include <vector>

#include "perception/recovery.h"
#include "perception/table.h"
#include "perception/views.h"

namespace dofusion {

struct KnownRecoveryOptions {
  int threads = 1;
  DepthSigma sigma;                // of the readings; scaled to what the table's own readings scatter
  double cluster_distance = 0.08;  // metres between readings of objects that are searched for jointly
  int beam = 6;                    // partial scenes that are kept where adding object by object leaves something over
  int fewest_pixels = 40;          // that an object must show
  double min_score = 0.75;         // an object that explains less is not believed
  bool settle = true;              // let the recovered scene come to rest in physics
  double settle_distance = 0.006;  // metres, and
  double settle_angle = 0.1;       // radians that settling may move an object; else its seen pose is kept
};

// For every object seen, the library's object and the pose that explain the image best. Poses are hypothesised from
// the faces seen and from the ways objects rest, rendered and compared, aligned to the readings, and chosen jointly
// for objects that touch or hide each other, so that one label may hold several objects and several labels one. The
// scene is then settled in physics: objects lie exactly on what supports them. What no object of the library explains
// is left out, with its label unused. The result is sorted by label, then by pixels. `pixels` counts the readings that
// the object explains to 3 sigma; `score` is their share of the readings on or behind the object where it is in view,
// times the share of its label's readings that the whole scene explains; `label` is 0 for an object that the
// segmentation has missed. An empty list if there is no label above 1. Of an object that the image's border cuts, the
// part inside counts. Readings that are not finite or not positive count as none. Throws std::invalid_argument if an
// image is not of the camera's size, the camera's focal lengths are not positive, or the library is empty.
std::vector<RecoveredObject> recover_known(const DepthImage& depth, const Camera& camera, const Table& table,
                                           const LabelImage& labels, const std::vector<ObjectPtr>& library,
                                           const KnownRecoveryOptions& options = {});

// The same from several views of one scene together (on_common_table() gives them their common world): candidates come
// from the view that shows most of what is not yet explained; every pose is scored, aligned and chosen by the pixels of
// all views, so that views need not agree in their labels. `label` is that in the first view, 0 if the object is not
// seen there; `pixels` and `score` count all views. An empty list if no view has a label above 1. Throws
// std::invalid_argument as above, and without any view.
std::vector<RecoveredObject> recover_known(const std::vector<View>& views, const std::vector<ObjectPtr>& library,
                                           const KnownRecoveryOptions& options = {});

// Labels in the order of the recovered objects (2 + i for object i) where the reading is within 1 cm of what they would
// show: clusters that hold several objects are split, parts of one object joined, and what segmentation missed is
// there. The table keeps its label, and what no recovered object shows becomes 0.
LabelImage label_recovered(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
                           const std::vector<RecoveredObject>& objects);

}  // namespace dofusion
