// Rotations that leave a shape as it is, and its planar faces.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "stability/mesh.h"

namespace dofusion {

// The rotations about the frame's origin that map the mesh's corners onto themselves, to within `tolerance` times
// the diameter; the identity comes first. Found from the corners alone, so that the triangulation does not matter.
// Meshes of more than 400 corners (curved ones) get the identity only.
std::vector<Eigen::Matrix3d> rotation_symmetries(const TriangleMesh& mesh, double tolerance = 1e-3);

// A flat part of the surface.
struct PlanarFace {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // outward, unit
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  // metres
  std::vector<Eigen::Vector3d> corners;                // of its triangles, each once, in no order
  double area = 0.0;                                   // square metres
};

// Triangles in one plane, joined; the largest first, at most `limit`, none smaller than 1 % of the surface.
std::vector<PlanarFace> planar_faces(const TriangleMesh& mesh, int limit = 24);

// How many of the rotations map `direction` (unit) to itself: the order of the symmetry about it.
int symmetry_order(const std::vector<Eigen::Matrix3d>& symmetries, const Eigen::Vector3d& direction);

// Faces that no symmetry maps to an earlier one.
std::vector<PlanarFace> distinct_faces(const std::vector<PlanarFace>& faces,
                                       const std::vector<Eigen::Matrix3d>& symmetries);

}  // namespace dofusion
