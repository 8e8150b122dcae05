#include "stability/shapes.h"

#include <cmath>
#include <stdexcept>

namespace dofusion {
namespace {

// Maps a prism's axes (polygon in x-y, extrusion along z) by a rotation that keeps orientation.
TriangleMesh rearranged(TriangleMesh mesh, int x_from, int y_from, int z_from) {
  for (Eigen::Vector3d& v : mesh.vertices) v = Eigen::Vector3d(v[x_from], v[y_from], v[z_from]);
  return mesh;
}

TriangleMesh turned_inside_out(TriangleMesh mesh) {
  for (Eigen::Vector3i& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

// A prism with its section in x-z and its length along y.
TriangleMesh prism_along_y(const std::vector<Eigen::Vector2d>& section_xz, double half_length) {
  // (x, z, y) swaps two axes, which mirrors the mesh: turn its triangles as well.
  return turned_inside_out(rearranged(prism_mesh(section_xz, -half_length, half_length), 0, 2, 1));
}

// A prism with its section in y-z and its length along x.
TriangleMesh prism_along_x(const std::vector<Eigen::Vector2d>& section_yz, double half_length) {
  return rearranged(prism_mesh(section_yz, -half_length, half_length), 2, 0, 1);
}

TriangleMesh square_pyramid() {
  TriangleMesh mesh;
  mesh.vertices = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  return mesh;
}

// The block in units of half a cube edge, as it is tabulated.
TriangleMesh block_in_units(const std::string& name) {
  const double root2 = std::sqrt(2.0);
  if (name == "cube") return box_mesh({2, 2, 2});
  if (name == "rectangle") return box_mesh({2, 2, 4});
  if (name == "half_rectangle") return box_mesh({4, 2, 1});
  if (name == "tall_triangle") return prism_along_y({{-1, -2}, {1, -2}, {-1, 2}}, 1.0);
  if (name == "middle_triangle") return prism_along_y({{-1, -1}, {1, -1}, {0, 1}}, 1.0);
  if (name == "tetrahedron") return square_pyramid();
  if (name == "hat") return prism_along_x({{-root2, 0}, {root2, 0}, {0, root2}}, 1.0);
  std::string known;
  for (const std::string& block : block_names()) known += (known.empty() ? "" : ", ") + block;
  throw std::invalid_argument("unknown block '" + name + "'; the blocks are " + known);
}

}  // namespace

const std::vector<std::string>& block_names() {
  static const std::vector<std::string> names = {"cube",            "rectangle",   "half_rectangle", "tall_triangle",
                                                 "middle_triangle", "tetrahedron", "hat"};
  return names;
}

TriangleMesh block_mesh(const std::string& name) {
  const TriangleMesh mesh = scaled(block_in_units(name), Eigen::Vector3d::Constant(kBlockUnit));
  return translated(mesh, -centre_of_mass(mesh));
}

TriangleMesh box_mesh(const Eigen::Vector3d& edges) {
  if (!(edges.minCoeff() > 0.0)) throw std::invalid_argument("a box needs positive edges");
  const Eigen::Vector3d h = edges / 2.0;
  return prism_mesh({{-h.x(), -h.y()}, {h.x(), -h.y()}, {h.x(), h.y()}, {-h.x(), h.y()}}, -h.z(), h.z());
}

TriangleMesh prism_mesh(const std::vector<Eigen::Vector2d>& polygon, double z_min, double z_max) {
  const int n = static_cast<int>(polygon.size());
  if (n < 3 || !(z_min < z_max)) throw std::invalid_argument("a prism needs three corners and a height");
  TriangleMesh mesh;
  for (const double z : {z_min, z_max}) {
    for (const Eigen::Vector2d& p : polygon) mesh.vertices.emplace_back(p.x(), p.y(), z);
  }
  for (int i = 1; i + 1 < n; ++i) {
    mesh.triangles.emplace_back(0, i + 1, i);              // bottom, seen from below
    mesh.triangles.emplace_back(n, n + i, n + i + 1);      // top
  }
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    mesh.triangles.emplace_back(i, j, n + j);
    mesh.triangles.emplace_back(i, n + j, n + i);
  }
  return mesh;
}

TriangleMesh cylinder_mesh(double radius, double height) {
  if (!(radius > 0.0)) throw std::invalid_argument("a cylinder needs a positive radius");
  constexpr int kSides = 64;
  std::vector<Eigen::Vector2d> circle;
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2.0 * M_PI * i / kSides;
    circle.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return prism_mesh(circle, -height / 2.0, height / 2.0);
}

TriangleMesh sphere_mesh(double radius) {
  if (!(radius > 0.0)) throw std::invalid_argument("a sphere needs a positive radius");
  constexpr int kRings = 32, kSides = 64;
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, -radius}};
  for (int ring = 1; ring < kRings; ++ring) {
    const double polar = M_PI * ring / kRings;
    for (int side = 0; side < kSides; ++side) {
      const double azimuth = 2.0 * M_PI * side / kSides;
      mesh.vertices.emplace_back(radius * std::sin(polar) * std::cos(azimuth),
                                 radius * std::sin(polar) * std::sin(azimuth), -radius * std::cos(polar));
    }
  }
  mesh.vertices.emplace_back(0, 0, radius);
  const int top = static_cast<int>(mesh.vertices.size()) - 1;
  const auto corner = [](int ring, int side) { return 1 + (ring - 1) * kSides + side % kSides; };
  for (int side = 0; side < kSides; ++side) {
    mesh.triangles.emplace_back(0, corner(1, side + 1), corner(1, side));
    for (int ring = 1; ring + 1 < kRings; ++ring) {
      mesh.triangles.emplace_back(corner(ring, side), corner(ring, side + 1), corner(ring + 1, side + 1));
      mesh.triangles.emplace_back(corner(ring, side), corner(ring + 1, side + 1), corner(ring + 1, side));
    }
    mesh.triangles.emplace_back(corner(kRings - 1, side), corner(kRings - 1, side + 1), top);
  }
  return mesh;
}

}  // namespace dofusion
