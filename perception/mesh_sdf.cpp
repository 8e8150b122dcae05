#include "perception/mesh_sdf.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <string>

#include "perception/morton_order.h"
#include "perception/triangle_tree.h"
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

}  // namespace

struct MeshSdf::Impl {
  Eigen::Vector3d centre;  // of the mesh; what follows is relative to it, where floats are finest
  std::size_t open_edges = 0;
  std::vector<SignedTriangle> triangles;
  TriangleTree tree;
  std::vector<NodeDipoles> dipoles;  // of an open mesh

  // The triangle that is nearest, by way of one that was near to a point close by, or -1.
  int nearest(const Eigen::Vector3d& p, int start_slot) const {
    if (std::max(tree.half_size, p.cwiseAbs().maxCoeff()) < kFarthestCoordinate)
      return best_nearest_function()(arrays_of(tree), p.data(), start_slot).slot;
    NearestTriangle nearest;
    for (int slot = 0; slot < static_cast<int>(tree.triangle.size()); ++slot) {
      if (tree.triangle[slot] < 0) continue;
      const double squared = distance_to_triangle(triangles[tree.triangle[slot]], p).squared;
      if (squared < nearest.squared) nearest = {slot, squared};
    }
    return nearest.slot;
  }

  // `slot`: of the nearest triangle.
  double distance(const Eigen::Vector3d& p, int slot) const {
    if (slot < 0) return p.allFinite() ? std::numeric_limits<double>::infinity() : std::nan("");
    const TriangleDistance nearest = distance_to_triangle(triangles[tree.triangle[slot]], p);
    const double side = dipoles.empty() ? nearest.side : 0.5 - winding_number(tree, dipoles, p);
    return std::copysign(std::sqrt(nearest.squared), side);
  }
};

MeshSdf::MeshSdf(const TriangleMesh& mesh) : impl_(std::make_unique<Impl>()) {
  const TriangleMesh welded = weld(mesh);
  impl_->open_edges = check_surface(welded);
  const BoundingBox box = bounding_box(welded);
  impl_->centre = 0.5 * (box.min + box.max);
  const TriangleMesh centred = translated(welded, -impl_->centre);
  impl_->triangles = signed_triangles(centred);
  impl_->tree = make_triangle_tree(centred);
  if (impl_->open_edges > 0) impl_->dipoles = make_dipoles(impl_->tree);
}

MeshSdf::~MeshSdf() = default;
MeshSdf::MeshSdf(MeshSdf&&) noexcept = default;
MeshSdf& MeshSdf::operator=(MeshSdf&&) noexcept = default;

std::size_t MeshSdf::open_edges() const { return impl_->open_edges; }

double MeshSdf::operator()(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d p = point - impl_->centre;
  return impl_->distance(p, impl_->nearest(p, -1));
}

std::vector<double> MeshSdf::distances(const std::vector<Eigen::Vector3d>& points, int threads) const {
  constexpr std::int64_t kChunk = 1024;
  const std::vector<std::uint32_t> order = morton_order(points);
  const auto count = static_cast<std::int64_t>(points.size());
  std::vector<double> distances(points.size());
  parallel_for((count + kChunk - 1) / kChunk, threads, [&](std::int64_t chunk, int) {
    int slot = -1;
    for (std::int64_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      const Eigen::Vector3d p = points[order[i]] - impl_->centre;
      slot = impl_->nearest(p, slot);
      distances[order[i]] = impl_->distance(p, slot);
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
