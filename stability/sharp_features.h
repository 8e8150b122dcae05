// The edges and corners of a solid: where two of them touch, one of these takes part.
#pragma once

#include <vector>

#include "stability/mesh.h"

namespace dofusion {

// In the mesh's frame and unit.
struct SharpFeatures {
  struct Edge {
    Eigen::Vector3d from, to;
  };
  std::vector<Edge> edges;               // each once, cut up as the triangles cut it
  std::vector<Eigen::Vector3d> corners;  // where such edges end, branch, or bend by more than the angle
};

// Edges along which the surface bends by more than `angle` radians, or ends. Vertices are compared by position. O(n).
// Triangles without area count as part of the edge that they lie on.
SharpFeatures sharp_features(const TriangleMesh& mesh, double angle = M_PI / 6.0);

}  // namespace dofusion
