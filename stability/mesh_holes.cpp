#include "stability/mesh_holes.h"

#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

#include <Eigen/Geometry>

#include "stability/mesh_topology.h"

namespace dofusion {
namespace {

using Loop = std::vector<int>;  // vertices, in the direction in which triangles that fill it run
using Edges = std::multimap<int, int>;

// The sides that filling triangles need: against those of the triangles that are there.
Edges missing_sides(const TriangleMesh& mesh) {
  const std::vector<HalfEdge> edges = half_edges(mesh, position_ids(mesh));
  Edges missing;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const auto same = [&](std::size_t j) {
      return j < edges.size() && edges[j].low == edges[i].low && edges[j].high == edges[i].high;
    };
    if (same(i + 1) || (i > 0 && same(i - 1))) continue;
    if (edges[i].forward) {
      missing.emplace(edges[i].high, edges[i].low);
    } else {
      missing.emplace(edges[i].low, edges[i].high);
    }
  }
  return missing;
}

// Follows sides from one vertex to the next; where the path comes back to one of its own, the loop is cut off, so that
// holes that touch at a vertex are apart.
std::vector<Loop> loops_of(Edges sides) {
  std::vector<Loop> loops;
  std::map<int, std::size_t> place;  // on the path
  while (!sides.empty()) {
    Loop path{sides.begin()->first};
    place.clear();
    place[path.front()] = 0;
    while (true) {
      const auto side = sides.find(path.back());
      if (side == sides.end()) {
        if (path.size() == 1) break;
        throw std::invalid_argument("holes of a mesh whose triangles are not wound consistently");
      }
      const int next = side->second;
      sides.erase(side);
      const auto seen = place.find(next);
      if (seen == place.end()) {
        place[next] = path.size();
        path.push_back(next);
        continue;
      }
      const auto start = static_cast<std::ptrdiff_t>(seen->second);
      loops.emplace_back(path.begin() + start, path.end());
      for (std::size_t i = seen->second + 1; i < path.size(); ++i) place.erase(path[i]);
      path.resize(seen->second + 1);
    }
  }
  return loops;
}

double area_of(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  return 0.5 * (b - a).cross(c - a).norm();
}

// Triangles of least area in all between the loop's corners, by dynamic programming. A triangle without area costs a
// little, so that none is made of corners in a row unless there is no other way.
void fill_by_least_area(TriangleMesh& mesh, const Loop& loop) {
  const int n = static_cast<int>(loop.size());
  const auto corner = [&](int i) -> const Eigen::Vector3d& { return mesh.vertices[loop[i]]; };
  double extent = 0.0;
  for (int i = 1; i < n; ++i) extent = std::max(extent, (corner(i) - corner(0)).squaredNorm());
  const auto cost = [&](int i, int k, int j) {
    const double area = area_of(corner(i), corner(k), corner(j));
    return area > 1e-9 * extent ? area : area + 1e-6 * extent;
  };
  std::vector<double> least(static_cast<std::size_t>(n) * n, 0.0);  // (n, n): of the part from corner i to corner j
  std::vector<int> apex(static_cast<std::size_t>(n) * n, -1);
  const auto at = [n](int i, int j) { return static_cast<std::size_t>(i) * n + j; };
  for (int length = 2; length < n; ++length) {
    for (int i = 0; i + length < n; ++i) {
      const int j = i + length;
      double best = std::numeric_limits<double>::infinity();
      for (int k = i + 1; k < j; ++k) {
        const double apart = least[at(i, k)] + least[at(k, j)];
        if (!(apart < best)) continue;
        const double sum = apart + cost(i, k, j);
        if (!(sum < best)) continue;
        best = sum;
        apex[at(i, j)] = k;
      }
      least[at(i, j)] = best;
    }
  }
  std::vector<std::pair<int, int>> pending{{0, n - 1}};
  while (!pending.empty()) {
    const auto [i, j] = pending.back();
    pending.pop_back();
    if (j - i < 2) continue;
    const int k = apex[at(i, j)];
    mesh.triangles.emplace_back(loop[i], loop[k], loop[j]);
    pending.emplace_back(i, k);
    pending.emplace_back(k, j);
  }
}

void fill_by_fan(TriangleMesh& mesh, const Loop& loop) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const int v : loop) mean += mesh.vertices[v] / static_cast<double>(loop.size());
  const int centre = static_cast<int>(mesh.vertices.size());
  mesh.vertices.push_back(mean);
  for (std::size_t i = 0; i < loop.size(); ++i)
    mesh.triangles.emplace_back(loop[i], loop[(i + 1) % loop.size()], centre);
}

}  // namespace

FilledMesh fill_holes(const TriangleMesh& input) {
  constexpr std::size_t kManyEdges = 300;  // the time for the least area grows with the third power: 50 ms
  FilledMesh filled;
  filled.mesh = weld(input);
  Edges sides = missing_sides(filled.mesh);
  filled.open_edges = sides.size();
  const double area_before = surface_area(filled.mesh);
  for (const Loop& loop : loops_of(std::move(sides))) {
    ++filled.holes;
    if (loop.size() <= kManyEdges) {
      fill_by_least_area(filled.mesh, loop);
    } else {
      fill_by_fan(filled.mesh, loop);
    }
  }
  const double area = surface_area(filled.mesh);
  filled.area_share = area > 0.0 ? (area - area_before) / area : 0.0;
  return filled;
}

}  // namespace dofusion
