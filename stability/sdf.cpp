#include "stability/sdf.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dofusion {

double box_signed_distance(const Eigen::Vector3d& edges, const Eigen::Vector3d& point) {
  const Eigen::Vector3d q = point.cwiseAbs() - edges / 2.0;
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

MeshDistance::MeshDistance(const TriangleMesh& mesh) : triangles_(signed_triangles(mesh)) {}

double MeshDistance::operator()(const Eigen::Vector3d& p) const {
  TriangleDistance nearest{std::numeric_limits<double>::infinity(), 1.0};
  for (const SignedTriangle& triangle : triangles_) {
    const TriangleDistance distance = distance_to_triangle(triangle, p);
    if (distance.squared < nearest.squared) nearest = distance;
  }
  return std::copysign(std::sqrt(nearest.squared), nearest.side);
}

double SdfGrid::operator()(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d last = (size.cast<double>().array() - 1.0).matrix();
  const Eigen::Vector3d wanted = (point - origin) / spacing;
  const Eigen::Vector3d inside = wanted.cwiseMax(0.0).cwiseMin(last);
  const Eigen::Vector3i node = inside.cast<int>().cwiseMin(size.array().matrix() - Eigen::Vector3i::Constant(2));
  const Eigen::Vector3d f = inside - node.cast<double>();
  const std::size_t row = static_cast<std::size_t>(size.x()), slice = row * static_cast<std::size_t>(size.y());
  const float* v = values.data() + node.x() + row * node.y() + slice * node.z();
  const auto along_x = [&](const float* p) { return p[0] + f.x() * (p[1] - p[0]); };
  const auto in_slice = [&](const float* p) {
    const double near = along_x(p), far = along_x(p + row);
    return near + f.y() * (far - near);
  };
  const double bottom = in_slice(v), top = in_slice(v + slice);
  return bottom + f.z() * (top - bottom) + (wanted - inside).norm() * spacing;
}

SdfGrid empty_sdf_grid(const BoundingBox& box, const SdfGridOptions& options) {
  if (options.nodes < 2 || !(options.margin >= 0.0)) throw std::invalid_argument("an SDF grid needs two nodes a side");
  const Eigen::Vector3d extent = box.max - box.min;
  const double margin = options.margin * extent.maxCoeff();
  const Eigen::Vector3d padded = extent.array() + 2.0 * margin;
  SdfGrid grid;
  grid.spacing = padded.maxCoeff() / (options.nodes - 1);
  if (!(grid.spacing > 0.0)) throw std::invalid_argument("an SDF grid over a box without extent");
  grid.size = ((padded / grid.spacing).array().ceil().cast<int>() + 1).max(2).matrix();
  // Centred, so that the grid is as symmetric as the solid.
  grid.origin = (box.min + box.max) / 2.0 - (grid.size.array() - 1).cast<double>().matrix() * grid.spacing / 2.0;
  return grid;
}

std::vector<Eigen::Vector3d> node_positions(const SdfGrid& grid) {
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(static_cast<std::size_t>(grid.size.cast<long>().prod()));
  for (int z = 0; z < grid.size.z(); ++z)
    for (int y = 0; y < grid.size.y(); ++y)
      for (int x = 0; x < grid.size.x(); ++x)
        positions.push_back(grid.origin + grid.spacing * Eigen::Vector3d(x, y, z));
  return positions;
}

SdfGrid make_sdf_grid(const BoundingBox& box, const DistanceFunction& distance, const SdfGridOptions& options) {
  SdfGrid grid = empty_sdf_grid(box, options);
  for (const Eigen::Vector3d& p : node_positions(grid)) grid.values.push_back(static_cast<float>(distance(p)));
  return grid;
}

}  // namespace dofusion
