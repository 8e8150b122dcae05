#include "perception/mesh_sdf.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "perception/embree_handles.h"
#include "perception/morton_order.h"
#include "perception/winding_number.h"
#include "stability/mesh_holes.h"
#include "stability/mesh_topology.h"
#include "stability/parallel_for.h"
#include "stability/signed_triangles.h"

namespace dofusion {
namespace {

std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g %%", 100.0 * share);
  return text;
}

// The number of open edges.
std::size_t check_surface(const TriangleMesh& mesh) {
  const SurfaceFaults faults = surface_faults(mesh);
  if (mesh.triangles.empty() || faults.odd.count > 0 || faults.unbalanced.count > 0) {
    throw std::invalid_argument("a signed distance needs a surface with one inside; this mesh with " +
                                std::to_string(mesh.triangles.size()) +
                                " triangles has none, or inner walls, or flipped triangles");
  }
  if (faults.open.count == 0) return 0;
  const FilledMesh filled = fill_holes(mesh);
  if (filled.area_share > kMostOpenShare) {
    throw std::invalid_argument("a signed distance needs a closed mesh; the holes of this one, " +
                                std::to_string(filled.open_edges) + " open edges, would take " +
                                percent(filled.area_share) + " of its surface, more than " + percent(kMostOpenShare));
  }
  return filled.open_edges;
}

struct Query {
  const std::vector<SignedTriangle>& triangles;
  Eigen::Vector3d point;
  double coordinate_size;  // the largest coordinate of point and mesh
  int nearest = -1;        // triangle; -1: none, as for a point that is not finite
  TriangleDistance distance{std::numeric_limits<double>::infinity(), 1.0};

  void try_triangle(int triangle) {
    const TriangleDistance candidate = distance_to_triangle(triangles[triangle], point);
    if (!(candidate.squared < distance.squared)) return;
    distance = candidate;
    nearest = triangle;
  }
};

// Embree culls boxes in float; a radius a little too large costs a few triangles more and misses none.
float safe_radius(const Query& query) {
  constexpr double kFloatError = 4.0 * std::numeric_limits<float>::epsilon();
  const double radius = std::sqrt(query.distance.squared) * (1.0 + kFloatError) + kFloatError * query.coordinate_size;
  return static_cast<float>(radius);
}

// Called by Embree for every triangle whose box is within the radius; shrinks the radius.
bool visit_triangle(RTCPointQueryFunctionArguments* arguments) {
  Query& query = *static_cast<Query*>(arguments->userPtr);
  const double before = query.distance.squared;
  query.try_triangle(static_cast<int>(arguments->primID));
  if (!(query.distance.squared < before)) return false;
  const float radius = safe_radius(query);
  if (!(radius < arguments->query->radius)) return false;
  arguments->query->radius = radius;
  return true;
}

}  // namespace

struct MeshSdf::Impl {
  Eigen::Vector3d centre;  // of the mesh; what follows is relative to it, where floats are finest
  double half_size = 0.0;  // the largest coordinate
  std::size_t open_edges = 0;
  std::vector<SignedTriangle> triangles;
  EmbreeDevice device;
  EmbreeScene scene;
  std::optional<WindingNumber> winding_number;  // of an open mesh

  // The triangle that is nearest to the point. `start`: one that is likely near, whose distance bounds the search from
  // the outset, or -1.
  Query find_nearest(const Eigen::Vector3d& p, int start) const {
    constexpr double kFarthest = 1e15;  // beyond, squares may not be floats
    Query query{triangles, p, std::max(half_size, p.cwiseAbs().maxCoeff())};
    if (start >= 0) query.try_triangle(start);
    if (!(query.coordinate_size < kFarthest)) {
      for (std::size_t i = 0; i < triangles.size(); ++i) query.try_triangle(static_cast<int>(i));
      return query;
    }
    RTCPointQuery ball;
    ball.x = static_cast<float>(p.x());
    ball.y = static_cast<float>(p.y());
    ball.z = static_cast<float>(p.z());
    ball.time = 0.0f;
    ball.radius = safe_radius(query);
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(scene.get(), &ball, &context, visit_triangle, &query);
    return query;
  }

  double signed_distance(const Query& query) const {
    if (!query.point.allFinite()) return std::nan("");
    const double side = winding_number ? 0.5 - (*winding_number)(query.point) : query.distance.side;
    return std::copysign(std::sqrt(query.distance.squared), side);
  }
};

MeshSdf::MeshSdf(const TriangleMesh& mesh) : impl_(std::make_unique<Impl>()) {
  const TriangleMesh welded = weld(mesh);
  impl_->open_edges = check_surface(welded);
  const BoundingBox box = bounding_box(welded);
  impl_->centre = 0.5 * (box.min + box.max);
  impl_->half_size = 0.5 * (box.max - box.min).maxCoeff();
  const TriangleMesh centred = translated(welded, -impl_->centre);
  impl_->triangles = signed_triangles(centred);
  impl_->device = make_embree_device();
  impl_->scene = make_triangle_scene(impl_->device.get(), centred);
  if (impl_->open_edges > 0) impl_->winding_number.emplace(centred);
}

MeshSdf::~MeshSdf() = default;
MeshSdf::MeshSdf(MeshSdf&&) noexcept = default;
MeshSdf& MeshSdf::operator=(MeshSdf&&) noexcept = default;

std::size_t MeshSdf::open_edges() const { return impl_->open_edges; }

double MeshSdf::operator()(const Eigen::Vector3d& point) const {
  return impl_->signed_distance(impl_->find_nearest(point - impl_->centre, -1));
}

std::vector<double> MeshSdf::distances(const std::vector<Eigen::Vector3d>& points, int threads) const {
  constexpr std::int64_t kChunk = 1024;
  const std::vector<std::uint32_t> order = morton_order(points);
  const auto count = static_cast<std::int64_t>(points.size());
  std::vector<double> distances(points.size());
  parallel_for((count + kChunk - 1) / kChunk, threads, [&](std::int64_t chunk, int) {
    const std::int64_t first = chunk * kChunk, size = std::min(kChunk, count - first);
    Eigen::Vector3d near_points[kChunk];  // together first: one by one each would be waited for
    for (std::int64_t i = 0; i < size; ++i) near_points[i] = points[order[first + i]] - impl_->centre;
    int nearest = -1;
    for (std::int64_t i = 0; i < size; ++i) {
      const Query query = impl_->find_nearest(near_points[i], nearest);
      nearest = query.nearest;
      distances[order[first + i]] = impl_->signed_distance(query);
    }
  });
  return distances;
}

SdfGrid mesh_to_sdf_grid(const TriangleMesh& mesh, const SdfGridOptions& options, int threads) {
  SdfGrid grid = empty_sdf_grid(bounding_box(mesh), options);
  const std::vector<double> distances = MeshSdf(mesh).distances(node_positions(grid), threads);
  grid.values.assign(distances.begin(), distances.end());
  return grid;
}

ObjectPtr with_distance_field(const ObjectPtr& object, const SdfGridOptions& options, int threads) {
  constexpr std::size_t kFewTriangles = 64;
  if (object->box_edges || (object->convex && object->mesh.triangles.size() <= kFewTriangles)) return object;
  auto copy = std::make_shared<Object>(*object);
  copy->sdf = std::make_shared<SdfGrid>(mesh_to_sdf_grid(object->mesh, options, threads));
  return copy;
}

Scene with_distance_fields(Scene scene, const SdfGridOptions& options, int threads) {
  for (ObjectPtr& object : scene.objects) object = with_distance_field(object, options, threads);
  return scene;
}

}  // namespace dofusion
