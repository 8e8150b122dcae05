// Exact signed distance to a closed mesh of any size, through a bounding volume hierarchy.
#pragma once

#include <memory>

#include "stability/mesh.h"
#include "stability/scene.h"
#include "stability/sdf.h"

namespace dofusion {

// Answers what MeshDistance (stability/sdf.h) answers, in about logarithmic time: the nearest triangle from Embree's
// point queries, the sign from angle-weighted pseudonormals, which is right on edges and corners too. Distances are
// computed in double. May be called from several threads.
class MeshSdf {
 public:
  explicit MeshSdf(const TriangleMesh& mesh);  // throws std::invalid_argument if the mesh is not closed
  ~MeshSdf();
  MeshSdf(MeshSdf&&) noexcept;
  MeshSdf& operator=(MeshSdf&&) noexcept;

  double operator()(const Eigen::Vector3d& point) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The grid around a closed mesh, in the mesh's frame. Throws std::invalid_argument if the mesh is not closed.
SdfGrid mesh_to_sdf_grid(const TriangleMesh& mesh, const SdfGridOptions& options = {});

// The object with a distance field for many fast queries. Boxes and convex solids of few triangles come back as they
// are: exact distances to them are as fast.
ObjectPtr with_distance_field(const ObjectPtr& object, const SdfGridOptions& options = {});
Scene with_distance_fields(Scene scene, const SdfGridOptions& options = {});

}  // namespace dofusion
