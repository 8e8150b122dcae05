#include "perception/geom_rays.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace dofusion {
namespace {

using Eigen::Vector3d;

struct Roots {
  double first, second;
};

// Where |o + t d| = radius, first <= second. Solved about the ray's point nearest to the centre, so that a far origin
// costs no digits.
template <class Vector>
std::optional<Roots> sphere_roots(const Vector& o, const Vector& d, double radius) {
  const double dd = d.squaredNorm();
  if (!(dd > 0.0)) return std::nullopt;
  const double middle = -o.dot(d) / dd;
  const double rest = radius * radius - (o + middle * d).squaredNorm();
  if (rest < 0.0) return std::nullopt;
  const double half = std::sqrt(rest / dd);
  return Roots{middle - half, middle + half};
}

// Keeps the nearest of the points that are offered.
class Nearest {
 public:
  void offer(double along, const Vector3d& normal) {
    if (along >= 0.0 && (!hit_ || along < hit_->along)) hit_ = RayHit{along, normal};
  }
  const std::optional<RayHit>& hit() const { return hit_; }

 private:
  std::optional<RayHit> hit_;
};

std::optional<RayHit> plane(const Vector3d& size, const Vector3d& o, const Vector3d& d) {
  if (!(d.z() < 0.0) || !(o.z() >= 0.0)) return std::nullopt;
  const double along = -o.z() / d.z();
  const Vector3d p = o + along * d;
  for (int k = 0; k < 2; ++k) {
    if (size[k] > 0.0 && std::abs(p[k]) > size[k]) return std::nullopt;
  }
  return RayHit{along, Vector3d::UnitZ()};
}

std::optional<RayHit> ellipsoid(const Vector3d& size, const Vector3d& o, const Vector3d& d) {
  const Vector3d o1 = o.cwiseQuotient(size), d1 = d.cwiseQuotient(size);
  const auto roots = sphere_roots(o1, d1, 1.0);
  if (!roots || roots->second < 0.0) return std::nullopt;
  const double along = roots->first >= 0.0 ? roots->first : roots->second;
  return RayHit{along, (o1 + along * d1).cwiseQuotient(size).normalized()};
}

// The round side of a cylinder about z.
void offer_side(double radius, double half, const Vector3d& o, const Vector3d& d, Nearest& nearest) {
  const auto roots = sphere_roots<Eigen::Vector2d>(o.head<2>(), d.head<2>(), radius);
  if (!roots) return;
  for (const double along : {roots->first, roots->second}) {
    const Vector3d p = o + along * d;
    if (std::abs(p.z()) <= half) nearest.offer(along, Vector3d(p.x(), p.y(), 0.0).normalized());
  }
}

std::optional<RayHit> cylinder(const Vector3d& size, const Vector3d& o, const Vector3d& d) {
  Nearest nearest;
  offer_side(size.x(), size.y(), o, d, nearest);
  if (d.z() != 0.0) {
    for (const double side : {-1.0, 1.0}) {
      const double along = (side * size.y() - o.z()) / d.z();
      if ((o + along * d).head<2>().squaredNorm() <= size.x() * size.x())
        nearest.offer(along, side * Vector3d::UnitZ());
    }
  }
  return nearest.hit();
}

std::optional<RayHit> capsule(const Vector3d& size, const Vector3d& o, const Vector3d& d) {
  Nearest nearest;
  offer_side(size.x(), size.y(), o, d, nearest);
  for (const double side : {-1.0, 1.0}) {
    const Vector3d from = o - Vector3d(0.0, 0.0, side * size.y());
    const auto roots = sphere_roots(from, d, size.x());
    if (!roots) continue;
    for (const double along : {roots->first, roots->second}) {
      const Vector3d p = from + along * d;
      if (side * p.z() >= 0.0) nearest.offer(along, p.normalized());
    }
  }
  return nearest.hit();
}

std::optional<RayHit> box(const Vector3d& size, const Vector3d& o, const Vector3d& d) {
  double enter = -std::numeric_limits<double>::infinity(), leave = std::numeric_limits<double>::infinity();
  int enter_axis = 0, leave_axis = 0;
  for (int k = 0; k < 3; ++k) {
    if (d[k] == 0.0) {
      if (std::abs(o[k]) > size[k]) return std::nullopt;
      continue;
    }
    const double away = std::copysign(size[k], d[k]);
    const double first = (-away - o[k]) / d[k], second = (away - o[k]) / d[k];
    if (first > enter) enter = first, enter_axis = k;
    if (second < leave) leave = second, leave_axis = k;
  }
  if (enter > leave || leave < 0.0) return std::nullopt;
  if (enter >= 0.0) return RayHit{enter, Vector3d::Unit(enter_axis) * std::copysign(1.0, -d[enter_axis])};
  return RayHit{leave, Vector3d::Unit(leave_axis) * std::copysign(1.0, d[leave_axis])};
}

}  // namespace

std::optional<RayHit> intersect(GeomType type, const Vector3d& size, const Vector3d& origin,
                                const Vector3d& direction) {
  switch (type) {
    case GeomType::kPlane:
      return plane(size, origin, direction);
    case GeomType::kSphere:
      return ellipsoid(Vector3d::Constant(size.x()), origin, direction);
    case GeomType::kCapsule:
      return capsule(size, origin, direction);
    case GeomType::kEllipsoid:
      return ellipsoid(size, origin, direction);
    case GeomType::kCylinder:
      return cylinder(size, origin, direction);
    case GeomType::kBox:
      return box(size, origin, direction);
    case GeomType::kHeightField:
    case GeomType::kMesh:
      return std::nullopt;
  }
  return std::nullopt;
}

bool contains(GeomType type, const Vector3d& size, const Vector3d& point) {
  switch (type) {
    case GeomType::kSphere:
      return point.norm() < size.x();
    case GeomType::kCapsule: {
      const Vector3d nearest(0.0, 0.0, std::clamp(point.z(), -size.y(), size.y()));  // of its straight part's axis
      return (point - nearest).norm() < size.x();
    }
    case GeomType::kEllipsoid:
      return point.cwiseQuotient(size).norm() < 1.0;
    case GeomType::kCylinder:
      return point.head<2>().norm() < size.x() && std::abs(point.z()) < size.y();
    case GeomType::kBox:
      return (point.cwiseAbs().array() < size.array()).all();
    case GeomType::kPlane:
    case GeomType::kHeightField:
    case GeomType::kMesh:
      return false;
  }
  return false;
}

}  // namespace dofusion
