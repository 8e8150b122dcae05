// Convex hulls, by Qhull.
#pragma once

#include <vector>

#include "stability/mesh.h"

namespace dofusion {

struct ConvexHullOptions {
  int max_corners = 0;    // at most so many corners, at least 5; 0 for all
  double flatness = 0.0;  // metres: a point no farther outside the hull of those before it is left out
};

// The boundary of the convex hull of `points`, triangulated, with only the corners kept. Corners are taken in turn,
// each the one farthest outside the hull of those before it, so that one of fewer corners lies slightly inside the
// exact one. Throws std::invalid_argument if the points do not span a volume or are not finite.
TriangleMesh convex_hull(const std::vector<Eigen::Vector3d>& points, const ConvexHullOptions& options = {});

}  // namespace dofusion
