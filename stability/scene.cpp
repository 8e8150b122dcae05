#include "stability/scene.h"

#include <cmath>
#include <stdexcept>

#include "stability/shapes.h"

namespace dofusion {
namespace {

// The edges of the box that the (centred) mesh is, if it is one aligned with the axes.
std::optional<Eigen::Vector3d> as_box(const TriangleMesh& mesh, double mesh_volume) {
  const BoundingBox box = bounding_box(mesh);
  const Eigen::Vector3d edges = box.max - box.min;
  const double tolerance = 1e-6 * edges.norm();
  if ((box.max + box.min).norm() > tolerance) return std::nullopt;
  for (const Eigen::Vector3d& v : mesh.vertices) {
    if ((v.cwiseAbs() - edges / 2.0).cwiseAbs().maxCoeff() > tolerance) return std::nullopt;
  }
  if (std::abs(mesh_volume / edges.prod() - 1.0) > 1e-5) return std::nullopt;
  return edges;
}

ObjectPtr finish(const std::string& name, TriangleMesh centred_mesh, double mesh_volume) {
  auto object = std::make_shared<Object>();
  object->name = name;
  object->box_edges = as_box(centred_mesh, mesh_volume);
  object->volume = mesh_volume;
  object->diameter = diameter(centred_mesh);
  object->convex = is_convex(centred_mesh);
  object->mesh = std::move(centred_mesh);
  return object;
}

}  // namespace

ObjectAndOffset make_object(const std::string& name, const TriangleMesh& mesh) {
  for (const Eigen::Vector3d& v : mesh.vertices) {
    if (!v.allFinite()) throw std::invalid_argument("mesh '" + name + "' has a coordinate that is not finite");
  }
  if (mesh.triangles.empty()) throw std::invalid_argument("mesh '" + name + "' has no triangles");
  if (!is_closed(mesh)) throw std::invalid_argument("mesh '" + name + "' is not closed");
  const Eigen::Vector3d origin = centre_of_mass(mesh);
  TriangleMesh centred = translated(mesh, -origin);
  const double mesh_volume = volume(centred);
  if (!(mesh_volume > 0.0)) throw std::invalid_argument("mesh '" + name + "' has no volume or is inside out");
  return {finish(name, std::move(centred), mesh_volume), origin};
}

ObjectPtr make_box(const std::string& name, const Eigen::Vector3d& edges) {
  return finish(name, box_mesh(edges), edges.prod());
}

ObjectPtr make_block(const std::string& name, double scale) {
  TriangleMesh mesh = scaled(block_mesh(name), Eigen::Vector3d::Constant(scale));
  const double mesh_volume = volume(mesh);
  return finish(name, std::move(mesh), mesh_volume);
}

std::vector<ObjectPtr> all_blocks() {
  std::vector<ObjectPtr> blocks;
  for (const std::string& name : block_names()) blocks.push_back(make_block(name));
  return blocks;
}

}  // namespace dofusion
