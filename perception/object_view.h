// What depth images show of one object, in the world frame.
#pragma once

#include <vector>

#include "perception/convex_body.h"
#include "perception/faces.h"

namespace dofusion {

struct ObservedFace {
  HalfSpace plane;                                   // world, outward
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // of its points
  int pixels = 0;
};

struct ObjectView {
  int label = 0;
  int pixels = 0;                       // with the label
  std::vector<Eigen::Vector3d> points;  // world, metres; readings on faces, or all if there is no face
  std::vector<double> sigma;            // of the points along their rays, metres
  std::vector<ObservedFace> faces;      // by falling number of pixels; faces of one plane are one
  double lowest = 0.0;                  // height that almost all points exceed, metres
};

// The view of the object with `label`. Without a reading it has no points.
ObjectView view_object(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
                       int label, const FaceOptions& options);

// One object seen by several cameras: the points of all, faces of one plane joined. Views without a point add nothing.
ObjectView joined(const std::vector<ObjectView>& views);

// The value below which a share of the values lies (0 … 1).
double quantile(std::vector<double> values, double share);

// Lowest and highest of the points along a direction, without a few outliers at either end.
struct Range {
  double low = 0.0, high = 0.0;
};
Range robust_range(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& direction);

}  // namespace dofusion
