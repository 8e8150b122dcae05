#include "stability/geom_mesh.h"

#include <cmath>
#include <stdexcept>

#include "stability/shapes.h"
#include "stability/swept_mesh.h"

namespace dofusion {
namespace {

constexpr int kSides = 96;
constexpr int kArcs = kSides / 4;  // from a pole to the equator

// A ball cut at its equator, the halves moved apart by twice `half_length`.
TriangleMesh capsule(double radius, double half_length) {
  std::vector<Eigen::Vector2d> profile;
  for (int k = -kArcs; k <= kArcs; ++k) {
    const double angle = 0.5 * M_PI * k / kArcs, z = radius * std::sin(angle);
    const double r = std::abs(k) == kArcs ? 0.0 : radius * std::cos(angle);
    if (k <= 0 || half_length == 0.0) profile.emplace_back(r, z - half_length);
    if (k >= 0 && half_length > 0.0) profile.emplace_back(r, z + half_length);
  }
  return revolution_mesh(profile, kSides);
}

TriangleMesh cylinder(double radius, double half_length) {
  return revolution_mesh({{0.0, -half_length}, {radius, -half_length}, {radius, half_length}, {0.0, half_length}},
                         kSides);
}

}  // namespace

TriangleMesh tessellated(const Geom& geom) {
  check_geom(geom);
  const Eigen::Vector3d& size = geom.size;
  switch (geom.type) {
    case GeomType::kSphere:
      return capsule(size.x(), 0.0);
    case GeomType::kCapsule:
      return capsule(size.x(), size.y());
    case GeomType::kEllipsoid:
      return scaled(capsule(1.0, 0.0), size);
    case GeomType::kCylinder:
      return cylinder(size.x(), size.y());
    case GeomType::kBox:
      return box_mesh(2.0 * size);
    case GeomType::kMesh:
      return *geom.mesh;
    case GeomType::kPlane:
    case GeomType::kHeightField:
      break;
  }
  throw std::invalid_argument("geom '" + geom.name + "': a plane or height field is no solid");
}

}  // namespace dofusion
