#include "perception/mesh_sdf.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "perception/embree_handles.h"
#include "stability/signed_triangles.h"

namespace dofusion {
namespace {

struct Query {
  const std::vector<SignedTriangle>& triangles;
  Eigen::Vector3d point;
  double coordinate_size;  // the largest coordinate of point and mesh
  TriangleDistance nearest{std::numeric_limits<double>::infinity(), 1.0};
};

// Embree culls boxes in float; a radius a little too large costs a few triangles more and misses none.
float safe_radius(double radius, double coordinate_size) {
  constexpr double kFloatError = 4.0 * std::numeric_limits<float>::epsilon();
  return static_cast<float>(radius * (1.0 + kFloatError) + kFloatError * coordinate_size);
}

// Called by Embree for every triangle whose box is within the radius; shrinks the radius.
bool visit_triangle(RTCPointQueryFunctionArguments* arguments) {
  Query& query = *static_cast<Query*>(arguments->userPtr);
  const TriangleDistance distance = distance_to_triangle(query.triangles[arguments->primID], query.point);
  if (!(distance.squared < query.nearest.squared)) return false;
  query.nearest = distance;
  const float radius = safe_radius(std::sqrt(distance.squared), query.coordinate_size);
  if (!(radius < arguments->query->radius)) return false;
  arguments->query->radius = radius;
  return true;
}

}  // namespace

struct MeshSdf::Impl {
  Eigen::Vector3d centre;  // of the mesh; what follows is relative to it, where floats are finest
  double half_size = 0.0;  // the largest coordinate
  std::vector<SignedTriangle> triangles;
  EmbreeDevice device;
  EmbreeScene scene;
};

MeshSdf::MeshSdf(const TriangleMesh& mesh) : impl_(std::make_unique<Impl>()) {
  if (mesh.triangles.empty() || !is_closed(mesh))
    throw std::invalid_argument("a signed distance needs a closed mesh; this one with " +
                                std::to_string(mesh.triangles.size()) + " triangles is not");
  const BoundingBox box = bounding_box(mesh);
  impl_->centre = 0.5 * (box.min + box.max);
  impl_->half_size = 0.5 * (box.max - box.min).maxCoeff();
  const TriangleMesh centred = weld(translated(mesh, -impl_->centre));
  impl_->triangles = signed_triangles(centred);
  impl_->device = make_embree_device();
  impl_->scene = make_triangle_scene(impl_->device.get(), centred);
}

MeshSdf::~MeshSdf() = default;
MeshSdf::MeshSdf(MeshSdf&&) noexcept = default;
MeshSdf& MeshSdf::operator=(MeshSdf&&) noexcept = default;

double MeshSdf::operator()(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d centred = point - impl_->centre;
  Query query{impl_->triangles, centred, std::max(impl_->half_size, centred.cwiseAbs().maxCoeff())};
  RTCPointQuery ball;
  ball.x = static_cast<float>(query.point.x());
  ball.y = static_cast<float>(query.point.y());
  ball.z = static_cast<float>(query.point.z());
  ball.time = 0.0f;
  ball.radius = std::numeric_limits<float>::infinity();
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(impl_->scene.get(), &ball, &context, visit_triangle, &query);
  return std::copysign(std::sqrt(query.nearest.squared), query.nearest.side);
}

SdfGrid mesh_to_sdf_grid(const TriangleMesh& mesh, const SdfGridOptions& options) {
  const MeshSdf distance(mesh);
  return make_sdf_grid(
      bounding_box(mesh), [&](const Eigen::Vector3d& point) { return distance(point); }, options);
}

ObjectPtr with_distance_field(const ObjectPtr& object, const SdfGridOptions& options) {
  constexpr std::size_t kFewTriangles = 64;
  if (object->box_edges || (object->convex && object->mesh.triangles.size() <= kFewTriangles)) return object;
  auto copy = std::make_shared<Object>(*object);
  copy->sdf = std::make_shared<SdfGrid>(mesh_to_sdf_grid(object->mesh, options));
  return copy;
}

Scene with_distance_fields(Scene scene, const SdfGridOptions& options) {
  for (ObjectPtr& object : scene.objects) object = with_distance_field(object, options);
  return scene;
}

}  // namespace dofusion
