#include "stability/swept_mesh.h"

#include <cmath>
#include <numeric>
#include <stdexcept>

namespace dofusion {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

// Twice the area of the triangle, positive if it runs counter-clockwise.
double turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// The corner at `at` of the remaining ones can be cut off: it is convex, and no other lies in its triangle or on it.
bool is_ear(const Polygon& polygon, const std::vector<int>& rest, std::size_t at, double least) {
  const std::size_t n = rest.size(), before = (at + n - 1) % n, after = (at + 1) % n;
  const Eigen::Vector2d &a = polygon[rest[before]], &b = polygon[rest[at]], &c = polygon[rest[after]];
  if (turn(a, b, c) <= least) return false;
  for (std::size_t i = 0; i < n; ++i) {
    if (i == before || i == at || i == after) continue;
    const Eigen::Vector2d& p = polygon[rest[i]];
    if (turn(a, b, p) >= -least && turn(b, c, p) >= -least && turn(c, a, p) >= -least) return false;
  }
  return true;
}

}  // namespace

double signed_area(const Polygon& polygon) {
  double twice = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return twice / 2.0;
}

std::vector<Eigen::Vector3i> triangulated(const Polygon& polygon) {
  const double area = signed_area(polygon);
  if (!(area > 0.0)) throw std::invalid_argument("a polygon needs corners that run counter-clockwise");
  std::vector<int> rest(polygon.size());
  std::iota(rest.begin(), rest.end(), 0);
  std::vector<Eigen::Vector3i> triangles;
  while (rest.size() >= 3) {
    const std::size_t n = rest.size();
    std::size_t ear = 0;
    while (ear < n && !is_ear(polygon, rest, ear, 1e-12 * area)) ++ear;
    if (ear == n) throw std::invalid_argument("a polygon whose sides cross or touch cannot be triangulated");
    triangles.emplace_back(rest[(ear + n - 1) % n], rest[ear], rest[(ear + 1) % n]);
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  return triangles;
}

TriangleMesh extrusion_mesh(const Polygon& polygon, double z_min, double z_max) {
  if (!(z_min < z_max)) throw std::invalid_argument("an extrusion needs a height");
  const int n = static_cast<int>(polygon.size());
  TriangleMesh mesh;
  for (const double z : {z_min, z_max}) {
    for (const Eigen::Vector2d& p : polygon) mesh.vertices.emplace_back(p.x(), p.y(), z);
  }
  for (const Eigen::Vector3i& t : triangulated(polygon)) {
    mesh.triangles.emplace_back(t[0], t[2], t[1]);              // bottom, seen from below
    mesh.triangles.emplace_back(n + t[0], n + t[1], n + t[2]);  // top
  }
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    mesh.triangles.emplace_back(i, j, n + j);
    mesh.triangles.emplace_back(i, n + j, n + i);
  }
  return mesh;
}

Eigen::Vector3d ring_corner(double radius, double z, int corner, int sides) {
  const double angle = 2.0 * M_PI * (corner % sides - 0.5) / sides;
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

TriangleMesh revolution_mesh(const Polygon& profile, int sides) {
  const int last = static_cast<int>(profile.size()) - 1;
  if (last < 2 || sides < 3 || profile.front().x() != 0.0 || profile.back().x() != 0.0 || !(signed_area(profile) > 0)) {
    throw std::invalid_argument("a solid of revolution needs a profile from the axis around the solid to the axis");
  }
  TriangleMesh mesh;
  mesh.vertices.emplace_back(0.0, 0.0, profile.front().y());
  for (int ring = 1; ring < last; ++ring) {
    if (!(profile[ring].x() > 0.0)) throw std::invalid_argument("a profile touches the axis at its ends alone");
    for (int i = 0; i < sides; ++i)
      mesh.vertices.push_back(ring_corner(profile[ring].x(), profile[ring].y(), i, sides));
  }
  mesh.vertices.emplace_back(0.0, 0.0, profile.back().y());
  const int top = static_cast<int>(mesh.vertices.size()) - 1;
  const auto corner = [sides](int ring, int i) { return 1 + (ring - 1) * sides + i % sides; };
  for (int i = 0; i < sides; ++i) {
    mesh.triangles.emplace_back(0, corner(1, i + 1), corner(1, i));
    for (int ring = 1; ring + 1 < last; ++ring) {
      mesh.triangles.emplace_back(corner(ring, i), corner(ring, i + 1), corner(ring + 1, i + 1));
      mesh.triangles.emplace_back(corner(ring, i), corner(ring + 1, i + 1), corner(ring + 1, i));
    }
    mesh.triangles.emplace_back(corner(last - 1, i), corner(last - 1, i + 1), top);
  }
  return mesh;
}

double revolution_moment(const Polygon& profile) {
  double moment = 0.0;
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    const Eigen::Vector2d &a = profile[i], &b = profile[i + 1];
    moment += (b.y() - a.y()) * (a.x() * a.x() + a.x() * b.x() + b.x() * b.x()) / 3.0;
  }
  return moment;
}

}  // namespace dofusion
