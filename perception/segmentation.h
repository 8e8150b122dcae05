// Which pixels of a depth image show the table, and which show which object.
#pragma once

#include <cstdint>

#include "perception/faces.h"
#include "perception/image.h"
#include "perception/recovery.h"
#include "perception/table.h"

namespace dofusion {

struct SegmentationOptions {
  DepthSigma sigma;             // of the depth readings
  bool calibrate = true;        // take `sigma` and `warp` from the scatter of the table's readings
  double warp = 0.0;            // sigmas by which the sensor bends planes; parallel faces join over such steps
  double table_band = 3.0;      // sigmas; readings nearer to the table's plane belong to it
  double max_height = 1.0;      // metres above the table; what is higher is no object
  double min_area = 4e-4;       // square metres of an object's visible side, seen head-on
  int min_pixels = 40;          // of an object
  double fragment_area = 8e-4;  // square metres; smaller parts join what they continue in depth
  double smooth_deg = 15.0;     // faces that meet at less are one surface, convex or not
  double max_in_front = 0.1;    // share of a part's readings that may lie before a face of the part it joins
  bool join_occluded = true;    // parts with common planes on both sides of a nearer object are one object
  FaceOptions faces;            // its sigma is set from the one above
};

// 0 nothing, 1 table, 2, 3, … objects, from the one with most pixels down; at most 254 objects. Readings above the
// table are split into planar faces; faces that meet at convex edges make an object, concave edges and steps in
// depth part objects (cf. Stein et al., "Object Partitioning using Local Convexity", CVPR 2014). Coplanar faces of
// objects that touch cannot be told apart. An image without an object gives no label above 1; of an object that the
// image's border cuts, what is inside has its label. Readings that are not finite or not positive count as none. Throws
// std::invalid_argument if the image is not of the camera's size or the camera's focal lengths are not positive.
LabelImage segment(const DepthImage& depth, const Camera& camera, const Table& table,
                   const SegmentationOptions& options = {});

// As segment, but with the objects from a user's mask: each value above 1 is one object (a 0/255 mask is one), in
// ascending order; of its pixels those count that have a reading above the table's band. The table is labelled as
// usual wherever the mask shows no object. Throws as segment, and if the mask is not of the camera's size.
LabelImage segment_with_mask(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& mask,
                             const SegmentationOptions& options = {});

// The number of objects: the largest label less one, 0 if there is none.
int count_objects(const LabelImage& labels);

}  // namespace dofusion
