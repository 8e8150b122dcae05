// Signed distance to a solid: negative inside, metres.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "stability/mesh.h"
#include "stability/signed_triangles.h"

namespace dofusion {

// Exact signed distance to a box with the given edges, centred at the origin.
double box_signed_distance(const Eigen::Vector3d& edges, const Eigen::Vector3d& point);

// Exact signed distance to a closed mesh by comparing all its triangles, the sign from angle-weighted pseudonormals
// (Baerentzen and Aanaes 2005), which is right on edges and corners too. Made for blocks of some ten triangles;
// perception/mesh_sdf.h is for large meshes.
class MeshDistance {
 public:
  explicit MeshDistance(const TriangleMesh& mesh);
  double operator()(const Eigen::Vector3d& point) const;

 private:
  std::vector<SignedTriangle> triangles_;
};

// Distances on a regular grid of nodes, interpolated trilinearly.
struct SdfGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // position of node (0, 0, 0)
  double spacing = 0.0;                              // metres between nodes
  Eigen::Vector3i size = Eigen::Vector3i::Zero();    // nodes along x, y, z
  std::vector<float> values;                         // (size.x * size.y * size.z), x fastest

  // Inside the grid the trilinear interpolation; outside, the value at the nearest point of the grid plus the
  // distance to it: an upper bound of the true distance.
  double operator()(const Eigen::Vector3d& point) const;
};

struct SdfGridOptions {
  int nodes = 48;       // along the longest side
  double margin = 0.5;  // of the longest side of the bounding box, added on every side
};

// The grid around a box, and where its nodes are, in the order of their values; values are empty. Throws
// std::invalid_argument on fewer than two nodes or a box without extent.
SdfGrid empty_sdf_grid(const BoundingBox& box, const SdfGridOptions& options = {});
std::vector<Eigen::Vector3d> node_positions(const SdfGrid& grid);

using DistanceFunction = std::function<double(const Eigen::Vector3d&)>;
SdfGrid make_sdf_grid(const BoundingBox& box, const DistanceFunction& distance, const SdfGridOptions& options = {});

}  // namespace dofusion
