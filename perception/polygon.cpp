#include "perception/polygon.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dofusion {
namespace {

constexpr double kSamePoint = 1e-7;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

Polygon convex_hull_2d(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
  });
  if (points.size() < 3) return points;
  Polygon hull;
  points.erase(
      std::unique(points.begin(), points.end(),
                  [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return (a - b).norm() < kSamePoint; }),
      points.end());
  if (points.size() < 3) return points;
  const auto add = [&](const Eigen::Vector2d& p, std::size_t keep) {
    while (hull.size() >= keep + 2 && cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0.0)
      hull.pop_back();
    hull.push_back(p);
  };
  for (const Eigen::Vector2d& p : points) add(p, 0);
  const std::size_t lower = hull.size() - 1;
  for (auto p = points.rbegin() + 1; p != points.rend(); ++p) add(*p, lower);
  hull.pop_back();
  return hull;
}

double area(const Polygon& polygon) {
  double twice = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) twice += cross(polygon[i], polygon[(i + 1) % polygon.size()]);
  return 0.5 * twice;
}

Polygon simplified(Polygon polygon, double tolerance, int max_corners) {
  while (polygon.size() > 3) {
    const std::size_t n = polygon.size();
    std::size_t least = 0;
    double least_height = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Vector2d &a = polygon[(i + n - 1) % n], &b = polygon[(i + 1) % n];
      const double length = (b - a).norm();
      const double height = length > 0.0 ? std::abs(cross(b - a, polygon[i] - a)) / length : 0.0;
      if (height < least_height) least_height = height, least = i;
    }
    if (least_height >= tolerance && static_cast<int>(n) <= max_corners) break;
    polygon.erase(polygon.begin() + static_cast<std::ptrdiff_t>(least));
  }
  return polygon;
}

Polygon clipped(const Polygon& polygon, const HalfPlane& half_plane) {
  Polygon result;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double da = half_plane.normal.dot(a) - half_plane.offset, db = half_plane.normal.dot(b) - half_plane.offset;
    if (da <= 0.0) result.push_back(a);
    if ((da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0)) result.push_back(a + (b - a) * da / (da - db));
  }
  return result.size() < 3 ? Polygon{} : result;
}

std::vector<HalfPlane> half_planes(const Polygon& polygon) {
  std::vector<HalfPlane> planes;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d edge = polygon[(i + 1) % polygon.size()] - polygon[i];
    if (edge.norm() < 10.0 * kSamePoint) continue;
    const Eigen::Vector2d normal = Eigen::Vector2d(edge.y(), -edge.x()).normalized();
    planes.push_back({normal, normal.dot(polygon[i])});
  }
  return planes;
}

bool contains(const Polygon& polygon, const Eigen::Vector2d& point) {
  if (polygon.size() < 3) return false;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d& a = polygon[i];
    if (cross(polygon[(i + 1) % polygon.size()] - a, point - a) < 0.0) return false;
  }
  return true;
}

Polygon rectangle(double yaw, const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  const Eigen::Vector2d x(std::cos(yaw), std::sin(yaw)), y(-x.y(), x.x());
  return {x * low.x() + y * low.y(), x * high.x() + y * low.y(), x * high.x() + y * high.y(),
          x * low.x() + y * high.y()};
}

double least_rectangle_yaw(const Polygon& polygon) {
  double best_yaw = 0.0, best_area = std::numeric_limits<double>::infinity();
  for (const HalfPlane& side : half_planes(polygon)) {
    const Eigen::Vector2d x = side.normal, y(-x.y(), x.x());
    double low_x = std::numeric_limits<double>::infinity(), high_x = -low_x, low_y = low_x, high_y = -low_x;
    for (const Eigen::Vector2d& p : polygon) {
      low_x = std::min(low_x, x.dot(p));
      high_x = std::max(high_x, x.dot(p));
      low_y = std::min(low_y, y.dot(p));
      high_y = std::max(high_y, y.dot(p));
    }
    const double size = (high_x - low_x) * (high_y - low_y);
    if (size < best_area) best_area = size, best_yaw = std::atan2(x.y(), x.x());
  }
  best_yaw = std::fmod(best_yaw, M_PI / 2.0);
  return best_yaw < 0.0 ? best_yaw + M_PI / 2.0 : best_yaw;
}

}  // namespace dofusion
