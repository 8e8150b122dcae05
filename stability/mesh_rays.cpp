#include "stability/mesh_rays.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

namespace dofusion {
namespace {

constexpr std::size_t kEntriesPerTriangle = 8;  // of the grid, on average
constexpr int kFinestResolution = 512;

// Twice the signed area of the triangle that the point makes with an edge, in y-z: the same number but for its sign
// whichever triangle asks. A point on the edge is taken for one that is moved a little along y, and far less along z; 0
// is left to edges along x.
double beside(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double y, double z, bool swapped) {
  const Eigen::Vector3d &from = swapped ? b : a, &to = swapped ? a : b;
  const double dy = to.y() - from.y(), dz = to.z() - from.z();
  const double exact = dy * (z - from.z()) - dz * (y - from.y());
  const double tie = dz != 0.0 ? -dz : dy;
  const double twice = exact != 0.0 ? exact : tie == 0.0 ? 0.0 : std::copysign(1e-300, tie);
  return swapped ? -twice : twice;
}

std::optional<RayCrossing> crossing(const TriangleMesh& mesh, const Eigen::Vector3i& t, double y, double z) {
  const Eigen::Vector3d &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
  const double w_c = beside(a, b, y, z, t[0] > t[1]), w_a = beside(b, c, y, z, t[1] > t[2]),
               w_b = beside(c, a, y, z, t[2] > t[0]);
  const bool leaves = w_a > 0.0 && w_b > 0.0 && w_c > 0.0;
  if (!leaves && !(w_a < 0.0 && w_b < 0.0 && w_c < 0.0)) return std::nullopt;
  // Counter-clockwise in y-z: the normal has a part towards +x, and the line leaves.
  return RayCrossing{(w_a * a.x() + w_b * b.x() + w_c * c.x()) / (w_a + w_b + w_c), leaves ? -1 : 1};
}

}  // namespace

MeshRays::MeshRays(const TriangleMesh& mesh) : mesh_(weld(mesh)) {
  if (mesh_.triangles.empty()) throw std::invalid_argument("lines through a mesh without triangles");
  const BoundingBox box = bounding_box(mesh_);
  low_ = box.min.tail<2>();
  const Eigen::Vector2d size = (box.max - box.min).tail<2>();
  int resolution =
      std::clamp(static_cast<int>(std::sqrt(static_cast<double>(mesh_.triangles.size()))), 1, kFinestResolution);
  // Long triangles lie in many cells; coarser cells keep the memory in proportion.
  for (;; resolution = (resolution + 1) / 2) {
    resolution_ = resolution;
    cell_ = (size / resolution).cwiseMax(1e-12 * size.norm() + 1e-300);
    std::size_t entries = 0;
    for (const Eigen::Vector3i& t : mesh_.triangles) {
      const Eigen::Vector2d a = mesh_.vertices[t[0]].tail<2>(), b = mesh_.vertices[t[1]].tail<2>(),
                            c = mesh_.vertices[t[2]].tail<2>();
      const Eigen::Vector2i span = cell_of(a.cwiseMax(b).cwiseMax(c)) - cell_of(a.cwiseMin(b).cwiseMin(c));
      entries += static_cast<std::size_t>(span.x() + 1) * static_cast<std::size_t>(span.y() + 1);
    }
    if (resolution == 1 || entries <= kEntriesPerTriangle * mesh_.triangles.size()) break;
  }
  sort_into_cells(resolution_);
}

Eigen::Vector2i MeshRays::cell_of(const Eigen::Vector2d& yz) const {
  const Eigen::Vector2d at = (yz - low_).cwiseQuotient(cell_);
  const auto clamped = [&](double x) { return static_cast<int>(std::clamp(x, 0.0, resolution_ - 1.0)); };
  return {clamped(at.x()), clamped(at.y())};
}

void MeshRays::sort_into_cells(int resolution) {
  const auto for_each_cell = [&](const Eigen::Vector3i& t, auto visit) {
    const Eigen::Vector2d a = mesh_.vertices[t[0]].tail<2>(), b = mesh_.vertices[t[1]].tail<2>(),
                          c = mesh_.vertices[t[2]].tail<2>();
    const Eigen::Vector2i from = cell_of(a.cwiseMin(b).cwiseMin(c)), to = cell_of(a.cwiseMax(b).cwiseMax(c));
    for (int v = from.y(); v <= to.y(); ++v) {
      for (int u = from.x(); u <= to.x(); ++u) visit(static_cast<std::size_t>(v) * resolution + u);
    }
  };
  start_.assign(static_cast<std::size_t>(resolution) * resolution + 1, 0);
  for (const Eigen::Vector3i& t : mesh_.triangles) for_each_cell(t, [&](std::size_t cell) { ++start_[cell + 1]; });
  for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
  triangles_.resize(start_.back());
  std::vector<std::size_t> next(start_.begin(), start_.end() - 1);
  for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
    for_each_cell(mesh_.triangles[i], [&](std::size_t cell) { triangles_[next[cell]++] = static_cast<int>(i); });
  }
}

std::vector<RayCrossing> MeshRays::along_x(double y, double z) const {
  const Eigen::Vector2i at = cell_of({y, z});
  const std::size_t cell = static_cast<std::size_t>(at.y()) * resolution_ + at.x();
  std::vector<RayCrossing> crossings;
  for (std::size_t i = start_[cell]; i < start_[cell + 1]; ++i) {
    if (const auto found = crossing(mesh_, mesh_.triangles[triangles_[i]], y, z)) crossings.push_back(*found);
  }
  std::stable_sort(crossings.begin(), crossings.end(),
                   [](const RayCrossing& a, const RayCrossing& b) { return a.x < b.x; });
  return crossings;
}

bool MeshRays::inside(const Eigen::Vector3d& point) const {
  int solids = 0;
  for (const RayCrossing& crossing : along_x(point.y(), point.z())) {
    if (crossing.x < point.x()) solids += crossing.change;
  }
  return solids > 0;
}

}  // namespace dofusion
