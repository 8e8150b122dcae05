#include "stability/shape_families.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "stability/convex_hull.h"
#include "stability/swept_mesh.h"

namespace dofusion {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

constexpr int kSides = 16;          // of bowls and mugs; each is one convex part of the wall
constexpr int kHandleSegments = 6;  // of a mug's handle, a part each

// A solid in any unit of length and the convex parts that fill it; none if it is convex.
struct Compound {
  TriangleMesh mesh;
  std::vector<TriangleMesh> parts;
};

double log_uniform(Rng& rng, double low, double high) { return std::exp(uniform(rng, std::log(low), std::log(high))); }

ObjectPtr finished(ShapeFamilyKind family, Compound solid) {
  const Eigen::Vector3d factors = Eigen::Vector3d::Constant(kShapeDiameter / diameter(solid.mesh));
  for (TriangleMesh& part : solid.parts) part = scaled(part, factors);
  return make_object(to_string(family), scaled(solid.mesh, factors), solid.parts).object;
}

ObjectPtr draw_box(Rng& rng) {
  constexpr double kLargestAspect = 8.0;
  const double aspect = log_uniform(rng, 1.0, kLargestAspect), middle = log_uniform(rng, 1.0, aspect);
  Eigen::Vector3d edges(1.0, middle, aspect);
  std::shuffle(edges.data(), edges.data() + 3, rng);
  return make_box(to_string(ShapeFamilyKind::kBox), edges * (kShapeDiameter / edges.norm()));
}

ObjectPtr draw_cylinder(Rng& rng) {
  const double height = log_uniform(rng, 0.25, 3.0);  // in diameters
  const double size = kShapeDiameter / std::hypot(1.0, height);
  return make_cylinder(to_string(ShapeFamilyKind::kCylinder), size / 2.0, size * height);
}

// Corners on a circle of radius 1, at least half a regular step apart, stretched to an ellipse if irregular.
Polygon draw_section(Rng& rng) {
  const int sides = uniform_int(rng, 3, 8);
  const bool regular = uniform(rng) < 0.5;
  const double step = 2.0 * M_PI / sides;
  // Each corner strays by up to a quarter step, so that neighbours stay half a step apart and the centre inside.
  const double stretch = regular ? 1.0 : log_uniform(rng, 0.5, 1.0);
  Polygon section;
  for (int i = 0; i < sides; ++i) {
    const double angle = step * (i + (regular ? 0.0 : uniform(rng, -0.25, 0.25)));
    section.emplace_back(std::cos(angle), stretch * std::sin(angle));
  }
  return section;
}

Compound draw_prism(Rng& rng) {
  const Polygon section = draw_section(rng);
  const double height = 2.0 * log_uniform(rng, 0.25, 3.0);  // the section is 2 wide
  return {prism_mesh(section, -height / 2.0, height / 2.0), {}};
}

Compound draw_polyhedron(Rng& rng) {
  const int corners = uniform_int(rng, 8, 24);
  // Directions at least 0.6 of the distance apart that the same number of evenly spread ones has: no slivers.
  const double apart = 0.6 * std::sqrt(4.0 * M_PI / corners);
  std::vector<Eigen::Vector3d> points;
  for (int tries = 0; static_cast<int>(points.size()) < corners; ++tries) {
    if (tries % 1000 == 999) points.clear();  // packed so that no further one fits
    const Eigen::Vector3d p = normal3(rng).normalized();
    const auto near = [&](const Eigen::Vector3d& q) { return (p - q).norm() < apart; };
    if (std::none_of(points.begin(), points.end(), near)) points.push_back(p);
  }
  const double middle = log_uniform(rng, 0.5, 1.0), smallest = log_uniform(rng, 0.5, 1.0);
  for (Eigen::Vector3d& p : points) p = p.cwiseProduct(Eigen::Vector3d(1.0, middle, smallest));
  return {convex_hull(points), {}};
}

TriangleMesh box_between(double x0, double y0, double x1, double y1, double half_depth) {
  return prism_mesh({{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}, -half_depth, half_depth);
}

// Sections lie in x-y with the longest edge 1.
double draw_half_depth(Rng& rng) { return uniform(rng, 0.15, 0.5); }

Compound draw_ell(Rng& rng) {
  const double width = uniform(rng, 0.5, 1.0), foot = uniform(rng, 0.15, 0.5), stem = width * uniform(rng, 0.2, 0.6);
  const double depth = draw_half_depth(rng);
  return {extrusion_mesh({{0, 0}, {width, 0}, {width, foot}, {stem, foot}, {stem, 1}, {0, 1}}, -depth, depth),
          {box_between(0, 0, width, foot, depth), box_between(0, foot, stem, 1, depth)}};
}

Compound draw_tee(Rng& rng) {
  const double width = uniform(rng, 0.5, 1.0), under = 1.0 - uniform(rng, 0.15, 0.5),
               stem = width * uniform(rng, 0.2, 0.6);
  const double left = (width - stem) * uniform(rng, 0.3, 0.7), right = left + stem;
  const double depth = draw_half_depth(rng);
  return {extrusion_mesh(
              {{left, 0}, {right, 0}, {right, under}, {width, under}, {width, 1}, {0, 1}, {0, under}, {left, under}},
              -depth, depth),
          {box_between(left, 0, right, under, depth), box_between(0, under, width, 1, depth)}};
}

Compound draw_arch(Rng& rng) {
  const double height = uniform(rng, 0.5, 1.0), under = height * (1.0 - uniform(rng, 0.2, 0.5));
  const double left = uniform(rng, 0.15, 0.35), right = 1.0 - uniform(rng, 0.15, 0.35);
  const double depth = draw_half_depth(rng);
  return {
      extrusion_mesh({{0, 0}, {left, 0}, {left, under}, {right, under}, {right, 0}, {1, 0}, {1, height}, {0, height}},
                     -depth, depth),
      {box_between(0, 0, left, under, depth), box_between(right, 0, 1, under, depth),
       box_between(0, under, 1, height, depth)}};
}

// One side of the ring that the section (r, z) sweeps.
TriangleMesh wedge(const Polygon& section, int side) {
  std::vector<Eigen::Vector3d> corners;
  for (const Eigen::Vector2d& p : section) {
    corners.push_back(ring_corner(p.x(), p.y(), side, kSides));
    corners.push_back(ring_corner(p.x(), p.y(), side + 1, kSides));
  }
  return convex_hull(corners);
}

// A bottom (r, z) that is convex once turned, and a wall, a convex section, above it.
std::vector<TriangleMesh> turned_parts(const Polygon& bottom, const Polygon& wall) {
  std::vector<TriangleMesh> parts = {revolution_mesh(bottom, kSides)};
  for (int side = 0; side < kSides; ++side) parts.push_back(wedge(wall, side));
  return parts;
}

// Lengths in radii of the rim.
Compound draw_bowl(Rng& rng) {
  const double height = uniform(rng, 0.5, 1.2), foot = uniform(rng, 0.3, 0.7);
  const double wall = uniform(rng, 0.06, 0.15), bottom = uniform(rng, 0.06, 0.15) * 1.5;
  // The inner wall runs parallel to the outer one, `wall` away along the radius.
  const double inner_foot = foot + (1.0 - foot) * bottom / height - wall;
  const Eigen::Vector2d low(0, 0), outer_low(foot, 0), outer(1, height), inner(1.0 - wall, height),
      inner_low(inner_foot, bottom), floor(0, bottom);
  return {revolution_mesh({low, outer_low, outer, inner, inner_low, floor}, kSides),
          turned_parts({low, outer_low, inner_low, floor}, {outer_low, outer, inner, inner_low})};
}

// The handle of a mug: half a ring that stands on the flat side at x = `wall_x`, between half ellipses in x-z.
struct Handle {
  double wall_x, centre_z, height, reach, thickness, half_width;
  // The corner at `step` of kHandleSegments from the lower end, on the outer or the inner ellipse.
  Eigen::Vector2d corner(int step, bool outer) const {
    const double angle = M_PI * (static_cast<double>(step) / kHandleSegments - 0.5);
    const double inset = outer ? 0.0 : thickness;
    const bool end = step == 0 || step == kHandleSegments;  // there the cosine is not quite zero
    return {wall_x + (end ? 0.0 : (reach - inset) * std::cos(angle)),
            centre_z + (height / 2.0 - inset) * std::sin(angle)};
  }
};

// x-z sections along y: (x, z, y) mirrors, so the triangles are turned.
TriangleMesh along_y(TriangleMesh mesh) {
  for (Eigen::Vector3d& v : mesh.vertices) std::swap(v.y(), v.z());
  for (Eigen::Vector3i& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

std::vector<TriangleMesh> handle_parts(const Handle& handle) {
  std::vector<TriangleMesh> parts;
  for (int i = 0; i < kHandleSegments; ++i) {
    parts.push_back(along_y(prism_mesh(
        {handle.corner(i, true), handle.corner(i + 1, true), handle.corner(i + 1, false), handle.corner(i, false)},
        -handle.half_width, handle.half_width)));
  }
  return parts;
}

// The handle's surface without the two ends that stand on the wall.
TriangleMesh handle_surface(const Handle& handle) {
  Polygon outline;
  for (int i = 0; i <= kHandleSegments; ++i) outline.push_back(handle.corner(i, true));
  for (int i = kHandleSegments; i >= 0; --i) outline.push_back(handle.corner(i, false));
  TriangleMesh mesh = along_y(extrusion_mesh(outline, -handle.half_width, handle.half_width));
  const auto on_wall = [&](const Eigen::Vector3i& t) {
    return mesh.vertices[t[0]].x() == handle.wall_x && mesh.vertices[t[1]].x() == handle.wall_x &&
           mesh.vertices[t[2]].x() == handle.wall_x;
  };
  mesh.triangles.erase(std::remove_if(mesh.triangles.begin(), mesh.triangles.end(), on_wall), mesh.triangles.end());
  return mesh;
}

// The flat side at x = wall_x, |y| <= half_width, 0 <= z <= height, without the two places where the handle stands.
TriangleMesh pierced_side(const Handle& handle, double half_width, double height) {
  const double w = handle.half_width;
  const double z[4] = {handle.corner(0, true).y(), handle.corner(0, false).y(),
                       handle.corner(kHandleSegments, false).y(), handle.corner(kHandleSegments, true).y()};
  const Eigen::Vector2d a(-half_width, 0), b(half_width, 0), c(half_width, height), d(-half_width, height);
  TriangleMesh side;
  const auto add = [&](const Polygon& polygon) {  // in y-z, counter-clockwise seen from outside
    const int first = static_cast<int>(side.vertices.size());
    for (const Eigen::Vector2d& p : polygon) side.vertices.emplace_back(handle.wall_x, p.x(), p.y());
    for (const Eigen::Vector3i& t : triangulated(polygon))
      side.triangles.push_back(t + Eigen::Vector3i::Constant(first));
  };
  add({a, b, {w, z[0]}, {-w, z[0]}});
  add({{-w, z[3]}, {w, z[3]}, c, d});
  add({{-w, z[1]}, {w, z[1]}, {w, z[2]}, {-w, z[2]}});
  add({a, {-w, z[0]}, {-w, z[1]}, {-w, z[2]}, {-w, z[3]}, d});
  add({b, c, {w, z[3]}, {w, z[2]}, {w, z[1]}, {w, z[0]}});
  return side;
}

void append(TriangleMesh& mesh, const TriangleMesh& more) {
  const Eigen::Vector3i first = Eigen::Vector3i::Constant(static_cast<int>(mesh.vertices.size()));
  mesh.vertices.insert(mesh.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const Eigen::Vector3i& t : more.triangles) mesh.triangles.push_back(t + first);
}

// Lengths in radii of the wall's corners. The handle joins one flat side of the wall exactly, so that wall and handle
// have one closed surface.
Compound draw_mug(Rng& rng) {
  const double height = uniform(rng, 1.6, 2.8), wall = uniform(rng, 0.08, 0.15), bottom = uniform(rng, 0.1, 0.2);
  const Eigen::Vector2d low(0, 0), outer_low(1, 0), outer(1, height), inner(1.0 - wall, height),
      inner_low(1.0 - wall, bottom), floor(0, bottom);
  Compound mug{revolution_mesh({low, outer_low, outer, inner, inner_low, floor}, kSides),
               turned_parts({low, outer_low, {1, bottom}, floor}, {{1, bottom}, outer, inner, inner_low})};

  const double half_side = std::sin(M_PI / kSides);
  Handle handle{};
  handle.wall_x = ring_corner(1.0, 0.0, 0, kSides).x();
  handle.centre_z = height * uniform(rng, 0.48, 0.55);
  handle.height = height * uniform(rng, 0.5, 0.75);
  handle.reach = uniform(rng, 0.5, 0.8);
  handle.thickness = uniform(rng, 0.12, 0.2);
  handle.half_width = half_side * uniform(rng, 0.5, 0.9);

  auto& triangles = mug.mesh.triangles;
  const auto on_side = [&](const Eigen::Vector3i& t) {
    const auto at_wall = [&](int v) { return std::abs(mug.mesh.vertices[v].x() - handle.wall_x) < 1e-9; };
    return at_wall(t[0]) && at_wall(t[1]) && at_wall(t[2]);
  };
  triangles.erase(std::remove_if(triangles.begin(), triangles.end(), on_side), triangles.end());
  append(mug.mesh, pierced_side(handle, half_side, height));
  append(mug.mesh, handle_surface(handle));
  mug.mesh = weld(mug.mesh);
  for (TriangleMesh& part : handle_parts(handle)) mug.parts.push_back(std::move(part));
  return mug;
}

}  // namespace

const std::vector<std::string>& shape_family_names() {
  static const std::vector<std::string> names = {"box", "prism", "cylinder", "polyhedron", "ell",
                                                 "tee", "arch",  "bowl",     "mug"};
  return names;
}

const std::string& to_string(ShapeFamilyKind family) {
  return shape_family_names().at(static_cast<std::size_t>(family));
}

ShapeFamilyKind shape_family_kind_from_string(const std::string& name) {
  const auto& names = shape_family_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<ShapeFamilyKind>(found - names.begin());
  std::string known;
  for (const std::string& family : names) known += (known.empty() ? "" : ", ") + family;
  throw std::invalid_argument("unknown shape family '" + name + "'; choose " + known);
}

ObjectPtr draw_shape(ShapeFamilyKind family, Rng& rng) {
  switch (family) {
    case ShapeFamilyKind::kBox:
      return draw_box(rng);
    case ShapeFamilyKind::kCylinder:
      return draw_cylinder(rng);
    case ShapeFamilyKind::kPrism:
      return finished(family, draw_prism(rng));
    case ShapeFamilyKind::kPolyhedron:
      return finished(family, draw_polyhedron(rng));
    case ShapeFamilyKind::kEll:
      return finished(family, draw_ell(rng));
    case ShapeFamilyKind::kTee:
      return finished(family, draw_tee(rng));
    case ShapeFamilyKind::kArch:
      return finished(family, draw_arch(rng));
    case ShapeFamilyKind::kBowl:
      return finished(family, draw_bowl(rng));
    case ShapeFamilyKind::kMug:
      return finished(family, draw_mug(rng));
  }
  throw std::invalid_argument("unknown shape family");
}

}  // namespace dofusion
