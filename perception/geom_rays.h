// Where a ray enters the shapes that have a formula: exact, in double precision.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "stability/geom.h"

namespace dofusion {

struct RayHit {
  double along = 0.0;                                // the point is origin + along * direction
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit, outward, in the geom's frame
};

// The nearest point of the geom's surface with along >= 0, for a ray in the geom's frame with a direction of any
// length but 0: from outside where it enters, from inside where it leaves; a plane from z > 0 alone. Of `size` it
// takes what GeomType says. Nothing for meshes and height fields. A ray that touches a round surface without entering
// it (to within rounding) may or may not hit it.
std::optional<RayHit> intersect(GeomType type, const Eigen::Vector3d& size, const Eigen::Vector3d& origin,
                                const Eigen::Vector3d& direction);

// Whether a point in the geom's frame lies inside the geom, not on its surface. Nothing lies inside a plane; false for
// meshes and height fields.
bool contains(GeomType type, const Eigen::Vector3d& size, const Eigen::Vector3d& point);

}  // namespace dofusion
