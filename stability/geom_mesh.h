// Triangles of MuJoCo's shapes.
#pragma once

#include "stability/geom.h"
#include "stability/mesh.h"

namespace dofusion {

// The geom's surface in its own frame; closed, except for a plane. Round ones have their corners on the surface, 96
// about the axis, and lie at most 0.0011 radii inside it. A plane without an end is a square of half size `endless`
// (metres), seen from both sides. Meshes are as in the file. Throws std::invalid_argument as check_geom.
TriangleMesh tessellated(const Geom& geom, double endless = 5.0);

}  // namespace dofusion
