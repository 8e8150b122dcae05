#include "stability/geom_mesh.h"

#include <cmath>

#include "stability/shapes.h"

namespace dofusion {
namespace {

constexpr int kSides = 96;
constexpr int kArcs = kSides / 4;  // from a pole to the equator

// A profile (radius, z), both ends on the axis, upwards.
using Profile = std::vector<Eigen::Vector2d>;

TriangleMesh revolved(const Profile& profile) {
  TriangleMesh mesh;
  const int rings = static_cast<int>(profile.size()) - 2;
  for (int ring = 1; ring <= rings; ++ring) {
    const Eigen::Vector2d& p = profile[static_cast<std::size_t>(ring)];
    for (int k = 0; k < kSides; ++k) {
      const double angle = 2.0 * M_PI * k / kSides;
      mesh.vertices.emplace_back(p.x() * std::cos(angle), p.x() * std::sin(angle), p.y());
    }
  }
  const int bottom = static_cast<int>(mesh.vertices.size()), top = bottom + 1;
  mesh.vertices.emplace_back(0.0, 0.0, profile.front().y());
  mesh.vertices.emplace_back(0.0, 0.0, profile.back().y());
  for (int k = 0; k < kSides; ++k) {
    const int next = (k + 1) % kSides, last = (rings - 1) * kSides;
    mesh.triangles.emplace_back(bottom, next, k);
    mesh.triangles.emplace_back(top, last + k, last + next);
    for (int ring = 0; ring + 1 < rings; ++ring) {
      const int a = ring * kSides + k, b = ring * kSides + next;
      mesh.triangles.emplace_back(a, b, b + kSides);
      mesh.triangles.emplace_back(a, b + kSides, a + kSides);
    }
  }
  return mesh;
}

// A ball cut at its equator, the halves moved apart by twice `half_length`.
TriangleMesh capsule(double radius, double half_length) {
  Profile profile;
  for (int k = -kArcs; k <= kArcs; ++k) {
    const double angle = 0.5 * M_PI * k / kArcs, z = radius * std::sin(angle);
    const double r = std::abs(k) == kArcs ? 0.0 : radius * std::cos(angle);
    if (k <= 0 || half_length == 0.0) profile.emplace_back(r, z - half_length);
    if (k >= 0 && half_length > 0.0) profile.emplace_back(r, z + half_length);
  }
  return revolved(profile);
}

TriangleMesh cylinder(double radius, double half_length) {
  return revolved({{0.0, -half_length}, {radius, -half_length}, {radius, half_length}, {0.0, half_length}});
}

TriangleMesh rectangle(double half_x, double half_y) {
  return {{{-half_x, -half_y, 0.0}, {half_x, -half_y, 0.0}, {half_x, half_y, 0.0}, {-half_x, half_y, 0.0}},
          {{0, 1, 2}, {0, 2, 3}}};
}

}  // namespace

TriangleMesh tessellated(const Geom& geom, double endless) {
  check_geom(geom);
  const Eigen::Vector3d& size = geom.size;
  switch (geom.type) {
    case GeomType::kPlane:
      return rectangle(size.x() > 0.0 ? size.x() : endless, size.y() > 0.0 ? size.y() : endless);
    case GeomType::kHeightField:
      return height_field_mesh(*geom.height_field);
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
      break;
  }
  return *geom.mesh;
}

}  // namespace dofusion
