#include "stability/mesh_topology.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>

namespace dofusion {
namespace {

constexpr int kMostShellsTested = 1000;  // each costs a pass over the shells around it

std::uint64_t mixed(std::uint64_t x) {
  // The finaliser of splitmix64: spreads every bit over the word.
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

std::uint64_t hash_of(const Eigen::Vector3d& v) {
  std::uint64_t hash = 0;
  for (int k = 0; k < 3; ++k) {
    const double coordinate = v[k] + 0.0;  // turns -0.0 into 0.0, which compares equal
    std::uint64_t bits = 0;
    std::memcpy(&bits, &coordinate, sizeof bits);
    hash = mixed(hash ^ bits) + 0x9e3779b97f4a7c15ULL;
  }
  return hash;
}

void note(EdgeFault& fault, const TriangleMesh& mesh, const HalfEdge& edge, int triangles) {
  if (fault.count++ > 0) return;
  fault.from = mesh.vertices[edge.low];
  fault.to = mesh.vertices[edge.high];
  fault.triangles = triangles;
}

// Calls visit(first, last) for the half edges of every edge.
template <typename Visit>
void for_each_edge(const std::vector<HalfEdge>& edges, Visit visit) {
  for (auto first = edges.begin(); first != edges.end();) {
    auto last = first;
    while (last != edges.end() && last->low == first->low && last->high == first->high) ++last;
    visit(first, last);
    first = last;
  }
}

// A triangle's neighbour over an edge of exactly two; `agree` if they run through it in opposite directions.
struct Neighbour {
  int triangle = -1;
  bool agree = true;
};
using Neighbours = std::vector<std::array<Neighbour, 3>>;

Neighbours neighbours_of(const TriangleMesh& mesh) {
  Neighbours neighbours(mesh.triangles.size());
  std::vector<int> known(mesh.triangles.size(), 0);
  for_each_edge(half_edges(mesh, position_ids(mesh)), [&](auto first, auto last) {
    if (last - first != 2 || first[0].triangle == first[1].triangle) return;
    const int a = first[0].triangle, b = first[1].triangle;
    const bool agree = first[0].forward != first[1].forward;
    neighbours[a][known[a]++] = {b, agree};
    neighbours[b][known[b]++] = {a, agree};
  });
  return neighbours;
}

double six_volumes(const TriangleMesh& mesh, const Eigen::Vector3i& t, const Eigen::Vector3d& apex) {
  const Eigen::Vector3d &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
  return (a - apex).dot((b - apex).cross(c - apex));
}

// The solid angle that a triangle fills seen from p, signed (van Oosterom and Strackee 1983).
double solid_angle(const TriangleMesh& mesh, const Eigen::Vector3i& t, const Eigen::Vector3d& p) {
  const Eigen::Vector3d a = mesh.vertices[t[0]] - p, b = mesh.vertices[t[1]] - p, c = mesh.vertices[t[2]] - p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

struct Shell {
  bool closed = true;  // by itself; else it has no volume of its own
  std::vector<int> triangles;
  Eigen::AlignedBox3d box;
  double volume = 0.0;
};

std::vector<Shell> collect(const TriangleMesh& mesh, const Shells& shells) {
  std::vector<Shell> list(static_cast<std::size_t>(shells.count));
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    Shell& shell = list[shells.of_triangle[i]];
    const Eigen::Vector3i& t = mesh.triangles[i];
    shell.triangles.push_back(static_cast<int>(i));
    for (int k = 0; k < 3; ++k) shell.box.extend(mesh.vertices[t[k]]);
    shell.volume += six_volumes(mesh, t, mesh.vertices[mesh.triangles[shell.triangles.front()][0]]) / 6.0;
  }
  // Over an edge of more than two triangles a shell may be open.
  for_each_edge(half_edges(mesh, position_ids(mesh)), [&](auto first, auto last) {
    if (last - first == 2) return;
    std::map<int, int> balance;
    for (auto e = first; e != last; ++e) balance[shells.of_triangle[e->triangle]] += e->forward ? 1 : -1;
    for (const auto& [shell, sum] : balance) list[shell].closed = list[shell].closed && sum == 0;
  });
  return list;
}

// How many of the other shells hold this one.
int depth_of(const TriangleMesh& mesh, const std::vector<Shell>& shells, std::size_t index) {
  const Eigen::Vector3i& t = mesh.triangles[shells[index].triangles.front()];
  const Eigen::Vector3d p = (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0;
  int depth = 0;
  for (std::size_t other = 0; other < shells.size(); ++other) {
    if (other == index || !shells[other].box.contains(p)) continue;
    double angle = 0.0;
    for (const int i : shells[other].triangles) angle += solid_angle(mesh, mesh.triangles[i], p);
    depth += std::abs(angle) > 2.0 * M_PI ? 1 : 0;  // 4 pi inside, 0 outside
  }
  return depth;
}

void turn(Eigen::Vector3i& triangle) { std::swap(triangle[1], triangle[2]); }

}  // namespace

std::vector<int> position_ids(const TriangleMesh& mesh) {
  const std::size_t n = mesh.vertices.size();
  std::size_t size = 16;
  while (size < 2 * n) size *= 2;
  std::vector<int> table(size, -1);  // open addressing, at most half full
  std::vector<int> ids(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::size_t slot = hash_of(mesh.vertices[i]) & (size - 1);
    while (table[slot] >= 0 && mesh.vertices[table[slot]] != mesh.vertices[i]) slot = (slot + 1) & (size - 1);
    if (table[slot] < 0) table[slot] = static_cast<int>(i);
    ids[i] = table[slot];
  }
  return ids;
}

std::vector<HalfEdge> half_edges(const TriangleMesh& mesh, const std::vector<int>& ids) {
  std::vector<std::size_t> start(mesh.vertices.size() + 1, 0);  // of the edges with this lower end
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int e = 0; e < 3; ++e) ++start[static_cast<std::size_t>(std::min(ids[t[e]], ids[t[(e + 1) % 3]])) + 1];
  }
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<HalfEdge> edges(3 * mesh.triangles.size());
  std::vector<std::size_t> next(start.begin(), start.end() - 1);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Eigen::Vector3i& t = mesh.triangles[i];
    for (int e = 0; e < 3; ++e) {
      const int from = ids[t[e]], to = ids[t[(e + 1) % 3]];
      edges[next[std::min(from, to)]++] = {std::min(from, to), std::max(from, to), static_cast<int>(i), from < to};
    }
  }
  for (std::size_t v = 0; v + 1 < start.size(); ++v) {
    std::stable_sort(edges.begin() + static_cast<std::ptrdiff_t>(start[v]),
                     edges.begin() + static_cast<std::ptrdiff_t>(start[v + 1]),
                     [](const HalfEdge& a, const HalfEdge& b) { return a.high < b.high; });
  }
  return edges;
}

SurfaceFaults surface_faults(const TriangleMesh& mesh) {
  SurfaceFaults faults;
  for_each_edge(half_edges(mesh, position_ids(mesh)), [&](auto first, auto last) {
    const int triangles = static_cast<int>(last - first);
    if (first->low == first->high) {
      faults.points += static_cast<std::size_t>(triangles);
    } else if (triangles == 1) {
      note(faults.open, mesh, *first, triangles);
    } else if (triangles % 2 == 1) {
      note(faults.odd, mesh, *first, triangles);
    } else if (2 * std::count_if(first, last, [](const HalfEdge& e) { return e.forward; }) != triangles) {
      note(faults.unbalanced, mesh, *first, triangles);
    }
  });
  return faults;
}

std::optional<ConsistentWinding> wound_consistently(const TriangleMesh& mesh) {
  const Neighbours neighbours = neighbours_of(mesh);
  ConsistentWinding wound{mesh, {std::vector<int>(mesh.triangles.size(), -1), 0}, {}};
  std::vector<bool> turned(mesh.triangles.size(), false);
  std::vector<int> open;
  for (std::size_t seed = 0; seed < mesh.triangles.size(); ++seed) {
    if (wound.shells.of_triangle[seed] >= 0) continue;
    const int shell = wound.shells.count++;
    wound.touched.push_back(false);
    wound.shells.of_triangle[seed] = shell;
    open.push_back(static_cast<int>(seed));
    while (!open.empty()) {
      const int at = open.back();
      open.pop_back();
      for (const Neighbour& next : neighbours[at]) {
        if (next.triangle < 0) continue;
        const bool must_turn = turned[at] == next.agree;
        if (wound.shells.of_triangle[next.triangle] >= 0) {
          if (turned[next.triangle] != must_turn) return std::nullopt;
          continue;
        }
        wound.shells.of_triangle[next.triangle] = shell;
        turned[next.triangle] = must_turn;
        open.push_back(next.triangle);
        if (!must_turn) continue;
        turn(wound.mesh.triangles[next.triangle]);
        wound.touched[shell] = true;
      }
    }
  }
  return wound;
}

TriangleMesh with_outward_shells(const ConsistentWinding& wound) {
  TriangleMesh mesh = wound.mesh;
  std::vector<Shell> shells = collect(mesh, wound.shells);
  const double total = std::accumulate(shells.begin(), shells.end(), 0.0,
                                       [](double sum, const Shell& shell) { return sum + shell.volume; });
  if (total < 0.0) {
    for (Eigen::Vector3i& t : mesh.triangles) turn(t);
    for (Shell& shell : shells) shell.volume = -shell.volume;
  }
  if (shells.size() == 1) return mesh;
  int tested = 0;
  for (std::size_t i = 0; i < shells.size(); ++i) {
    if (!shells[i].closed || (!wound.touched[i] && shells[i].volume >= 0.0)) continue;
    if (++tested > kMostShellsTested) {
      throw std::invalid_argument("more than " + std::to_string(kMostShellsTested) + " of its " +
                                  std::to_string(shells.size()) + " shells are inside out; recompute its normals");
    }
    const bool inwards = depth_of(mesh, shells, i) % 2 == 1;
    if (inwards == (shells[i].volume < 0.0)) continue;
    for (const int t : shells[i].triangles) turn(mesh.triangles[t]);
  }
  return mesh;
}

TriangleMesh without_repeated_triangles(const TriangleMesh& mesh) {
  const std::vector<int> ids = position_ids(mesh);
  // Corners by id, the smallest first without changing the direction; then equal triangles are neighbours.
  std::vector<std::pair<std::array<int, 3>, int>> keys;
  keys.reserve(mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Eigen::Vector3i& t = mesh.triangles[i];
    std::array<int, 3> key = {ids[t[0]], ids[t[1]], ids[t[2]]};
    std::rotate(key.begin(), std::min_element(key.begin(), key.end()), key.end());
    keys.emplace_back(key, static_cast<int>(i));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<bool> repeated(mesh.triangles.size(), false);
  for (std::size_t i = 1; i < keys.size(); ++i) repeated[keys[i].second] = keys[i].first == keys[i - 1].first;
  TriangleMesh result{mesh.vertices, {}};
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (!repeated[i]) result.triangles.push_back(mesh.triangles[i]);
  }
  return result;
}

}  // namespace dofusion
