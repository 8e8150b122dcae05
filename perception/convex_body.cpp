#include "perception/convex_body.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Geometry>

#include "stability/convex_hull.h"

namespace dofusion {
namespace {

constexpr double kSamePlane = 1e-5;  // of normals (length 1) and offsets (metres)
constexpr double kMinVolume = 1e-9;  // cubic metres

std::vector<Eigen::Vector3d> edge_directions(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> directions;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d d = (mesh.vertices[t[(i + 1) % 3]] - mesh.vertices[t[i]]).normalized();
      const bool known = std::any_of(directions.begin(), directions.end(),
                                     [&](const Eigen::Vector3d& e) { return std::abs(e.dot(d)) > 1.0 - 1e-6; });
      if (!known && d.allFinite()) directions.push_back(d);
    }
  }
  return directions;
}

std::pair<double, double> extent(const TriangleMesh& mesh, const Eigen::Vector3d& axis) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Eigen::Vector3d& v : mesh.vertices) {
    low = std::min(low, axis.dot(v));
    high = std::max(high, axis.dot(v));
  }
  return {low, high};
}

}  // namespace

std::vector<HalfSpace> half_spaces(const TriangleMesh& convex) {
  std::vector<HalfSpace> planes;
  for (const Eigen::Vector3i& t : convex.triangles) {
    const Eigen::Vector3d& a = convex.vertices[t[0]];
    const Eigen::Vector3d n = (convex.vertices[t[1]] - a).cross(convex.vertices[t[2]] - a);
    if (n.norm() < 1e-12) continue;
    const HalfSpace plane{n.normalized(), n.normalized().dot(a)};
    const bool known = std::any_of(planes.begin(), planes.end(), [&](const HalfSpace& p) {
      return (p.normal - plane.normal).norm() < kSamePlane && std::abs(p.offset - plane.offset) < kSamePlane;
    });
    if (!known) planes.push_back(plane);
  }
  return planes;
}

std::optional<TriangleMesh> solid_hull(const std::vector<Eigen::Vector3d>& points) {
  try {
    TriangleMesh hull = convex_hull(points);
    if (volume(hull) < kMinVolume) return std::nullopt;
    return hull;
  } catch (const std::invalid_argument&) {  // the points span no volume
    return std::nullopt;
  }
}

std::optional<TriangleMesh> cut(const TriangleMesh& convex, const HalfSpace& half_space) {
  std::vector<Eigen::Vector3d> points;
  const auto height = [&](int i) { return half_space.normal.dot(convex.vertices[i]) - half_space.offset; };
  bool all_inside = true;
  for (std::size_t i = 0; i < convex.vertices.size(); ++i) {
    if (height(static_cast<int>(i)) <= 0.0) {
      points.push_back(convex.vertices[i]);
    } else {
      all_inside = false;
    }
  }
  if (all_inside) return convex;
  for (const Eigen::Vector3i& t : convex.triangles) {
    for (int i = 0; i < 3; ++i) {
      const int a = t[i], b = t[(i + 1) % 3];
      if (a > b) continue;  // every edge once
      const double ha = height(a), hb = height(b);
      if (ha * hb < 0.0)
        points.push_back(convex.vertices[a] + (convex.vertices[b] - convex.vertices[a]) * ha / (ha - hb));
    }
  }
  return points.size() < 4 ? std::nullopt : solid_hull(points);
}

std::optional<TriangleMesh> prism(const Eigen::Matrix3d& R, const Polygon& profile, double low, double high) {
  if (profile.size() < 3 || !(high > low)) return std::nullopt;
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector2d& p : profile) {
    points.push_back(R * Eigen::Vector3d(p.x(), p.y(), low));
    points.push_back(R * Eigen::Vector3d(p.x(), p.y(), high));
  }
  return solid_hull(points);
}

double plane_distance(const std::vector<HalfSpace>& body, const Eigen::Vector3d& point) {
  double largest = -std::numeric_limits<double>::infinity();
  for (const HalfSpace& plane : body) largest = std::max(largest, plane.normal.dot(point) - plane.offset);
  return largest;
}

std::optional<double> enter(const std::vector<HalfSpace>& body, const Eigen::Vector3d& origin,
                            const Eigen::Vector3d& direction) {
  double first = 0.0, last = std::numeric_limits<double>::infinity();
  for (const HalfSpace& plane : body) {
    const double speed = plane.normal.dot(direction), distance = plane.offset - plane.normal.dot(origin);
    if (std::abs(speed) < 1e-15) {
      if (distance < 0.0) return std::nullopt;
    } else if (speed < 0.0) {
      first = std::max(first, distance / speed);
    } else {
      last = std::min(last, distance / speed);
    }
  }
  if (first <= 0.0 || first >= last) return std::nullopt;
  return first;
}

Overlap find_overlap(const TriangleMesh& a, const TriangleMesh& b) {
  std::vector<Eigen::Vector3d> axes;
  for (const HalfSpace& plane : half_spaces(a)) axes.push_back(plane.normal);
  for (const HalfSpace& plane : half_spaces(b)) axes.push_back(plane.normal);
  for (const Eigen::Vector3d& ea : edge_directions(a)) {
    for (const Eigen::Vector3d& eb : edge_directions(b)) {
      const Eigen::Vector3d axis = ea.cross(eb);
      if (axis.norm() > 1e-6) axes.push_back(axis.normalized());
    }
  }
  Overlap least{std::numeric_limits<double>::infinity(), Eigen::Vector3d::UnitZ()};
  for (const Eigen::Vector3d& axis : axes) {
    const auto [low_a, high_a] = extent(a, axis);
    const auto [low_b, high_b] = extent(b, axis);
    // b moves along +axis by high_a - low_b, or along -axis by high_b - low_a.
    const double forward = high_a - low_b, backward = high_b - low_a;
    if (forward < least.depth) least = {forward, axis};
    if (backward < least.depth) least = {backward, -axis};
    if (least.depth <= 0.0) return least;
  }
  return least;
}

}  // namespace dofusion
