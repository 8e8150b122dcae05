// Convex hulls, by Qhull.
#pragma once

#include <vector>

#include "stability/mesh.h"

namespace dofusion {

// The boundary of the convex hull of `points`, triangulated, with only the corners kept. Throws
// std::invalid_argument if the points do not span a volume or are not finite.
TriangleMesh convex_hull(const std::vector<Eigen::Vector3d>& points);

}  // namespace dofusion
