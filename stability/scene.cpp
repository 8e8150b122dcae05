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

std::shared_ptr<Object> finish(const std::string& name, TriangleMesh centred_mesh, double mesh_volume) {
  auto object = std::make_shared<Object>();
  object->name = name;
  object->box_edges = as_box(centred_mesh, mesh_volume);
  object->kind = object->box_edges ? SolidKind::kBox : SolidKind::kMesh;
  object->volume = mesh_volume;
  object->inertia = inertia(centred_mesh);
  object->diameter = diameter(centred_mesh);
  object->convex = is_convex(centred_mesh);
  object->mesh = std::move(centred_mesh);
  return object;
}

// The same with the exact figures of the round solid that the mesh tessellates.
ObjectPtr finish_round(const std::string& name, SolidKind kind, const TriangleMesh& mesh, double exact_volume,
                       const Eigen::Vector3d& exact_inertia, double exact_diameter) {
  const auto object = finish(name, mesh, exact_volume);
  object->kind = kind;
  object->inertia = exact_inertia.asDiagonal();
  object->diameter = exact_diameter;
  return object;
}

}  // namespace

ObjectAndOffset make_object(const std::string& name, const TriangleMesh& mesh, const std::vector<TriangleMesh>& parts) {
  for (const Eigen::Vector3d& v : mesh.vertices) {
    if (!v.allFinite()) throw std::invalid_argument("mesh '" + name + "' has a coordinate that is not finite");
  }
  if (mesh.triangles.empty()) throw std::invalid_argument("mesh '" + name + "' has no triangles");
  if (!is_closed(mesh)) throw std::invalid_argument("mesh '" + name + "' is not closed");
  const Eigen::Vector3d origin = centre_of_mass(mesh);
  TriangleMesh centred = translated(mesh, -origin);
  const double mesh_volume = volume(centred);
  if (!(mesh_volume > 0.0)) throw std::invalid_argument("mesh '" + name + "' has no volume or is inside out");
  const auto object = finish(name, std::move(centred), mesh_volume);
  if (!object->convex) {
    for (const TriangleMesh& part : parts) object->parts.push_back(translated(part, -origin));
  }
  return {object, origin};
}

ObjectPtr make_box(const std::string& name, const Eigen::Vector3d& edges) {
  return finish(name, box_mesh(edges), edges.prod());
}

ObjectPtr make_cylinder(const std::string& name, double radius, double height) {
  const double solid_volume = M_PI * radius * radius * height;
  const double about_x = solid_volume * (3.0 * radius * radius + height * height) / 12.0;
  return finish_round(name, SolidKind::kCylinder, cylinder_mesh(radius, height), solid_volume,
                      {about_x, about_x, solid_volume * radius * radius / 2.0}, std::hypot(2.0 * radius, height));
}

ObjectPtr make_sphere(const std::string& name, double radius) {
  const double solid_volume = 4.0 / 3.0 * M_PI * radius * radius * radius;
  return finish_round(name, SolidKind::kSphere, sphere_mesh(radius), solid_volume,
                      Eigen::Vector3d::Constant(0.4 * solid_volume * radius * radius), 2.0 * radius);
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

ObjectPtr scaled(const Object& object, const Eigen::Vector3d& factors) {
  if (!(factors.minCoeff() > 0.0)) throw std::invalid_argument("an object is scaled by positive factors");
  const BoundingBox box = bounding_box(object.mesh);
  const Eigen::Vector3d edges = (box.max - box.min).cwiseProduct(factors);
  const bool round = factors.x() == factors.y();
  if (object.kind == SolidKind::kBox) return make_box(object.name, edges);
  if (object.kind == SolidKind::kCylinder && round) return make_cylinder(object.name, edges.x() / 2.0, edges.z());
  if (object.kind == SolidKind::kSphere && round && factors.x() == factors.z()) {
    return make_sphere(object.name, edges.x() / 2.0);
  }
  TriangleMesh mesh = scaled(object.mesh, factors);
  const double mesh_volume = volume(mesh);
  const auto result = finish(object.name, std::move(mesh), mesh_volume);
  for (const TriangleMesh& part : object.parts) result->parts.push_back(scaled(part, factors));
  return result;
}

}  // namespace dofusion
