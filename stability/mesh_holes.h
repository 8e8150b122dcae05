// Holes of a surface, and surfaces that close them.
#pragma once

#include <cstddef>
#include <vector>

#include "stability/mesh.h"

namespace dofusion {

// A surface counts as slightly open while its holes would take no more than this share of the closed surface. A cube
// without one of its twelve triangles lacks 8.3 %; without a face 17 %, as a cup whose wall has no thickness may.
inline constexpr double kMostOpenShare = 0.1;

struct FilledMesh {
  TriangleMesh mesh;           // closed, but for faults other than holes
  std::size_t holes = 0;       // that were filled
  std::size_t open_edges = 0;  // of one triangle only, which bounded them
  double area_share = 0.0;     // of the filled holes, of the whole surface now
};

// Closes every hole, however large: one of up to 300 edges by the triangles of least area between its corners
// (Barequet and Sharir 1995), a larger one by a fan around its corners' mean. Vertices are welded first. Triangles must
// be wound consistently, as wound_consistently does. Throws std::invalid_argument if they are not.
FilledMesh fill_holes(const TriangleMesh& mesh);

}  // namespace dofusion
