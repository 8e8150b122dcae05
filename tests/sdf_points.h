// Points where signed distances go wrong, and independent ways to tell inside from outside there.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "stability/mesh.h"
#include "stability/random.h"

namespace dofusion {

// Offset by 1e-7 … 1e-3 m (log-uniform) in any direction from a point on an edge, or, every fourth, from a corner.
inline std::vector<Eigen::Vector3d> points_near_edges(const TriangleMesh& mesh, int count, Rng& rng) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3i& t =
        mesh.triangles[static_cast<std::size_t>(uniform_int(rng, 0, static_cast<int>(mesh.triangles.size()) - 1))];
    const int k = uniform_int(rng, 0, 2);
    const double share = i % 4 == 0 ? 0.0 : uniform(rng);
    const Eigen::Vector3d on = (1.0 - share) * mesh.vertices[t[k]] + share * mesh.vertices[t[(k + 1) % 3]];
    points.push_back(on + std::pow(10.0, uniform(rng, -7.0, -3.0)) * normal3(rng).normalized());
  }
  return points;
}

struct HalfSpace {
  Eigen::Vector3d normal;  // outward unit
  double offset = 0.0;
};

// Of a convex mesh.
inline std::vector<HalfSpace> half_spaces(const TriangleMesh& mesh) {
  std::vector<HalfSpace> planes;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    const Eigen::Vector3d normal = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).normalized();
    planes.push_back({normal, normal.dot(a)});
  }
  return planes;
}

inline bool inside_half_spaces(const std::vector<HalfSpace>& planes, const Eigen::Vector3d& p) {
  return std::all_of(planes.begin(), planes.end(),
                     [&](const HalfSpace& plane) { return plane.normal.dot(p) < plane.offset; });
}

// The mesh's solid angle over 4 pi, triangle by triangle: 1 inside, 0 outside (Van Oosterom and Strackee 1983).
// Independent of nearest points and pseudonormals.
inline double plain_winding_number(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  double solid_angle = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]] - p, b = mesh.vertices[t[1]] - p, c = mesh.vertices[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    solid_angle += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return solid_angle / (4.0 * 3.14159265358979323846);
}

// The mesh with its longest edge cut in the middle, and every other edge at least 0.7 times as long: still closed.
inline TriangleMesh with_longest_edge_halved(const TriangleMesh& input) {
  TriangleMesh mesh = weld(input);
  const auto length = [&](int i, int j) { return (mesh.vertices[i] - mesh.vertices[j]).norm(); };
  double longest = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) longest = std::max(longest, length(t[k], t[(k + 1) % 3]));
  std::map<std::pair<int, int>, int> middle;
  std::vector<Eigen::Vector3i> pending = mesh.triangles, done;
  while (!pending.empty()) {
    const Eigen::Vector3i t = pending.back();
    pending.pop_back();
    int cut = -1;
    double most = 0.7 * longest;
    for (int k = 0; k < 3; ++k) {
      if (length(t[k], t[(k + 1) % 3]) < most) continue;
      most = length(t[k], t[(k + 1) % 3]);
      cut = k;
    }
    if (cut < 0) {
      done.push_back(t);
      continue;
    }
    const int i = t[cut], j = t[(cut + 1) % 3], k = t[(cut + 2) % 3];
    const auto found = middle.emplace(std::minmax(i, j), static_cast<int>(mesh.vertices.size()));
    if (found.second) mesh.vertices.push_back(0.5 * (mesh.vertices[i] + mesh.vertices[j]));
    pending.emplace_back(i, found.first->second, k);
    pending.emplace_back(found.first->second, j, k);
  }
  mesh.triangles = done;
  return mesh;
}

}  // namespace dofusion
