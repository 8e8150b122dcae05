// Triangles of MuJoCo's shapes.
#pragma once

#include "stability/geom.h"
#include "stability/mesh.h"

namespace dofusion {

// The geom's surface in its own frame, closed, for files of triangles. Round ones have their corners on the surface, 96
// about the axis, and lie at most 0.0011 radii inside it. Meshes are as in the file. Throws std::invalid_argument as
// check_geom, and for planes and height fields, which MuJoCo has for surroundings alone.
TriangleMesh tessellated(const Geom& geom);

}  // namespace dofusion
