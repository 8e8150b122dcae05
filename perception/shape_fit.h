// The convex shape that explains what is seen of an object.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "perception/object_view.h"

namespace dofusion {

struct ShapeFitOptions {
  double level_deg = 12.0;      // a face inclined less to the table's plane is level
  double upright_deg = 12.0;    // a face inclined less to the vertical is upright
  double slack = 0.002;         // metres, with three sigmas of a reading: what a shape may miss it by
  double min_face_share = 0.1;  // of the largest face's pixels; smaller faces propose no shape
  int max_corners = 10;         // of a footprint or profile that is neither a rectangle nor a circle
  int circle_sides = 16;
  int max_hull_corners = 20;  // of the fallback hull; 2 n - 4 triangles
};

enum class ShapeKind { kUprightBox, kUprightCylinder, kUprightPrism, kLyingPrism, kTiltedBox, kHull };
std::string to_string(ShapeKind kind);

struct FittedShape {
  TriangleMesh mesh;                                // world, closed, convex
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  // world; axes of the shape, along its edges if it is a box
  ShapeKind kind = ShapeKind::kHull;
  double score = 0.0;  // share of the readings explained less those contradicted
};

// The images that a shape must agree with. An object has the same label in all of them.
struct ViewEvidence {
  const DepthImage& depth;
  const LabelImage& labels;
  const Camera& camera;
  Pose T_world_camera;
  DepthSigma sigma;
};
using ShapeEvidence = std::vector<ViewEvidence>;  // at least one

// The best of: a box, a cylinder or a prism that stands upright; a prism that lies; a box in any orientation; the hull
// of the points and their feet. All reach from what is seen down to z = support and not below. A shape gains by every
// reading on its surface and loses by every pixel in which it would hide what is seen behind it. nullopt if the
// points span no volume above the support.
std::optional<FittedShape> fit_shape(const ObjectView& view, double support, const ShapeEvidence& evidence,
                                     const ShapeFitOptions& options = {});

}  // namespace dofusion
