// Convex solids that together make up one that is not: what physics takes a bowl or an arch for.
#pragma once

#include <vector>

#include "stability/mesh.h"
#include "stability/scene.h"

namespace dofusion {

struct ConvexPartsOptions {
  int max_parts = 32;  // at least 1
  double tolerance =
      0.01;              // share of the solid's volume that the parts may have in excess of it; max_parts comes first
  int max_corners = 64;  // of a part, at least 5: the cost of a contact grows with them
};

// Approximate convex decomposition of a closed mesh, in the mesh's own frame. The solid is cut recursively, always the
// piece whose hull exceeds it most, by the plane that leaves the smallest hulls; then pieces are joined again where
// that adds little. Planes lie across the axes of the solid's largest faces, or its principal axes if it has none, and
// along its own faces where those are flat: solids of boxes come apart exactly, however they are turned. Cavities and
// several shells are fine; a convex mesh comes back as its hull. Same input, same parts. Time grows with the triangles:
// minutes beyond 100,000, where dofusion-place refuses meshes (apps/place_inputs.h). Throws std::invalid_argument
// if the mesh is not closed, has no volume or is inside out, or on bad options.
std::vector<TriangleMesh> convex_parts(const TriangleMesh& closed_mesh, const ConvexPartsOptions& options = {});

// The object with `parts` if it is not convex and has none yet; else the object itself. For whoever loads meshes: physics
// would find them anew for every model.
ObjectPtr with_convex_parts(const ObjectPtr& object, const ConvexPartsOptions& options = {});

// How far the union of convex `parts` is from the solid of a closed mesh, in shares of the solid's volume.
struct ConvexFit {
  double added = 0.0;    // in the parts and not in the solid
  double missing = 0.0;  // in the solid and in no part
};

// Measured exactly along lines_per_side^2 parallel lines. Throws std::invalid_argument if the mesh encloses nothing.
ConvexFit convex_fit(const TriangleMesh& closed_mesh, const std::vector<TriangleMesh>& parts, int lines_per_side = 128);

}  // namespace dofusion
