// Triangles of a closed mesh that tell on which side of the surface a point lies.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "stability/mesh.h"

namespace dofusion {

// A triangle with the angle-weighted pseudonormals (Baerentzen and Aanaes 2005) of its corners and edges; they need
// not have unit length.
struct SignedTriangle {
  Eigen::Vector3d a, b, c, normal;
  Eigen::Vector3d vertex_normals[3];
  Eigen::Vector3d edge_normals[3];  // ab, bc, ca
};

// Equal vertices are merged first. Throws std::invalid_argument without triangles.
std::vector<SignedTriangle> signed_triangles(const TriangleMesh& mesh);

struct TriangleDistance {
  double squared = 0.0;  // square metres
  double side = 0.0;     // positive outside, if this is the nearest of all the mesh's triangles
};
TriangleDistance distance_to_triangle(const SignedTriangle& triangle, const Eigen::Vector3d& point);

}  // namespace dofusion
