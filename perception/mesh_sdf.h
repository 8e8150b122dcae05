// Exact signed distance to a mesh of any size, through a bounding volume hierarchy.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "stability/mesh.h"
#include "stability/scene.h"
#include "stability/sdf.h"

namespace dofusion {

// Answers what MeshDistance (stability/sdf.h) answers, in about logarithmic time: the nearest triangle from Embree's
// point queries, its distance in double precision; negative inside. The sign comes from angle-weighted pseudonormals
// (Baerentzen and Aanaes 2005), which are right on edges and corners too. A mesh with small holes does as well: then
// the sign is that of the generalised winding number (perception/winding_number.h), right but for points about a hole's
// size from the hole. May be called from several threads.
class MeshSdf {
 public:
  // Throws std::invalid_argument if the mesh has no triangles, inner walls or flipped triangles (see surface_faults),
  // or holes that would take more than kMostOpenShare of the surface (stability/mesh_holes.h).
  explicit MeshSdf(const TriangleMesh& mesh);
  ~MeshSdf();
  MeshSdf(MeshSdf&&) noexcept;
  MeshSdf& operator=(MeshSdf&&) noexcept;

  bool watertight() const { return open_edges() == 0; }
  std::size_t open_edges() const;  // edges of one triangle only, which bound holes

  double operator()(const Eigen::Vector3d& point) const;  // metres; NaN if the point is not finite

  // Of many points at once; much faster than one by one, since each answer bounds its neighbours'. The result does not
  // depend on the number of threads.
  std::vector<double> distances(const std::vector<Eigen::Vector3d>& points, int threads = 1) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The grid around a mesh, in the mesh's frame; its nodes are exact to a float. Between them a distance, whose slope is
// 1, is interpolated with an error below sqrt(3)/2 of the spacing anywhere, and far less off edges and medial axes (of
// the default 48 nodes: tests/bench/README.md). Throws as MeshSdf does, and as make_sdf_grid.
SdfGrid mesh_to_sdf_grid(const TriangleMesh& mesh, const SdfGridOptions& options = {}, int threads = 1);

// The object with a distance field for many fast queries. Boxes and convex solids of few triangles come back as they
// are: exact distances to them are as fast.
ObjectPtr with_distance_field(const ObjectPtr& object, const SdfGridOptions& options = {}, int threads = 1);
Scene with_distance_fields(Scene scene, const SdfGridOptions& options = {}, int threads = 1);

}  // namespace dofusion
