#include "stability/sharp_features.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "stability/mesh_topology.h"

namespace dofusion {
namespace {

std::vector<Eigen::Vector3d> unit_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals;
  normals.reserve(mesh.triangles.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    normals.push_back((mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).normalized());
  }
  return normals;
}

// Two triangles that go on smoothly across their edge.
bool is_smooth(const std::vector<HalfEdge>& sides, std::size_t begin, std::size_t end,
               const std::vector<Eigen::Vector3d>& normals, double cosine) {
  if (end - begin != 2) return false;
  const Eigen::Vector3d &a = normals[sides[begin].triangle], &b = normals[sides[begin + 1].triangle];
  return a.isZero() || b.isZero() || a.dot(b) >= cosine;
}

}  // namespace

SharpFeatures sharp_features(const TriangleMesh& mesh, double angle) {
  const double cosine = std::cos(angle);
  const std::vector<int> ids = position_ids(mesh);
  const std::vector<HalfEdge> sides = half_edges(mesh, ids);
  const std::vector<Eigen::Vector3d> normals = unit_normals(mesh);

  SharpFeatures features;
  struct Incidence {
    int edges = 0;
    Eigen::Vector3d first = Eigen::Vector3d::Zero();  // unit, away from the vertex along its first edge
    bool bends = false;
  };
  std::vector<Incidence> at(mesh.vertices.size());
  const auto meet = [&](int vertex, const Eigen::Vector3d& away) {
    Incidence& here = at[static_cast<std::size_t>(vertex)];
    if (here.edges++ == 0) here.first = away;
    else if (-here.first.dot(away) < cosine) here.bends = true;
  };
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    const int low = sides[begin].low, high = sides[begin].high;
    while (end < sides.size() && sides[end].low == low && sides[end].high == high) ++end;
    if (low == high || is_smooth(sides, begin, end, normals, cosine)) continue;
    const Eigen::Vector3d &from = mesh.vertices[low], &to = mesh.vertices[high];
    features.edges.push_back({from, to});
    meet(low, (to - from).normalized());
    meet(high, (from - to).normalized());
  }
  for (std::size_t v = 0; v < at.size(); ++v) {
    if (at[v].edges == 1 || at[v].edges > 2 || at[v].bends) features.corners.push_back(mesh.vertices[v]);
  }
  return features;
}

}  // namespace dofusion
