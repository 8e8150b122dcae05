#include "stability/geom.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dofusion {
namespace {

[[noreturn]] void refuse(const Geom& geom, const std::string& why) {
  throw std::invalid_argument("geom '" + geom.name + "': " + why);
}

void check_size(const Geom& geom, int needed) {
  for (int k = 0; k < needed; ++k) {
    if (!(geom.size[k] > 0.0) || !std::isfinite(geom.size[k])) {
      refuse(geom, "its size " + std::to_string(geom.size[k]) + " is not a positive number of metres");
    }
  }
}

void check_mesh(const Geom& geom) {
  if (!geom.mesh || geom.mesh->triangles.empty()) refuse(geom, "a mesh without triangles");
  const auto count = static_cast<int>(geom.mesh->vertices.size());
  for (const Eigen::Vector3i& t : geom.mesh->triangles) {
    if (t.minCoeff() < 0 || t.maxCoeff() >= count) refuse(geom, "its mesh has a triangle without vertices");
  }
  for (const Eigen::Vector3d& v : geom.mesh->vertices) {
    if (!v.allFinite()) refuse(geom, "its mesh has a vertex that is not finite");
  }
}

void check_height_field(const Geom& geom) {
  if (!geom.height_field) refuse(geom, "its height field is missing");
  const HeightField& field = *geom.height_field;
  const bool whole = field.rows >= 2 && field.columns >= 2 &&
                     field.heights.size() == static_cast<std::size_t>(field.rows) * field.columns;
  if (!whole) refuse(geom, "a height field needs two rows and columns at least, and a height at each point");
  if (!(field.half_size.minCoeff() > 0.0) || !field.half_size.allFinite() || !(field.base >= 0.0) ||
      !std::isfinite(field.base)) {
    refuse(geom, "its height field's size is not a positive number of metres");
  }
  if (!std::all_of(field.heights.begin(), field.heights.end(), [](float h) { return std::isfinite(h); })) {
    refuse(geom, "its height field has a height that is not finite");
  }
}

// Indices of the grid's border, once around, counter-clockwise seen from above.
std::vector<int> border_points(int rows, int columns) {
  std::vector<int> border;
  for (int column = 0; column < columns - 1; ++column) border.push_back(column);
  for (int row = 0; row < rows - 1; ++row) border.push_back(row * columns + columns - 1);
  for (int column = columns - 1; column > 0; --column) border.push_back((rows - 1) * columns + column);
  for (int row = rows - 1; row > 0; --row) border.push_back(row * columns);
  return border;
}

}  // namespace

Pose camera_pose(const SceneCamera& camera, const std::vector<Pose>& T_world_body) {
  if (camera.body < 0) return camera.T_body_camera;
  return T_world_body.at(static_cast<std::size_t>(camera.body)) * camera.T_body_camera;
}

void check_geom(const Geom& geom) {
  if (!geom.T_body_geom.matrix().allFinite()) refuse(geom, "its pose is not finite");
  switch (geom.type) {
    case GeomType::kPlane:
      if (!geom.size.head<2>().allFinite()) refuse(geom, "its size is not finite");
      return;
    case GeomType::kHeightField:
      return check_height_field(geom);
    case GeomType::kMesh:
      return check_mesh(geom);
    case GeomType::kSphere:
      return check_size(geom, 1);
    case GeomType::kCapsule:
    case GeomType::kCylinder:
      return check_size(geom, 2);
    case GeomType::kEllipsoid:
    case GeomType::kBox:
      return check_size(geom, 3);
  }
  refuse(geom, "of an unknown type");
}

TriangleMesh height_field_mesh(const HeightField& field) {
  const int rows = field.rows, columns = field.columns, ground = rows * columns;
  TriangleMesh mesh;
  const auto x = [&](int column) { return (2.0 * column / (columns - 1) - 1.0) * field.half_size.x(); };
  const auto y = [&](int row) { return (2.0 * row / (rows - 1) - 1.0) * field.half_size.y(); };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      mesh.vertices.emplace_back(x(column), y(row), field.heights[static_cast<std::size_t>(row) * columns + column]);
    }
  }
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const int a = row * columns + column, b = a + 1, c = b + columns, d = a + columns;
      mesh.triangles.emplace_back(a, b, c);
      mesh.triangles.emplace_back(a, c, d);
    }
  }
  const std::vector<int> border = border_points(rows, columns);
  const auto around = static_cast<int>(border.size()), middle = ground + around;
  for (const int top : border) mesh.vertices.emplace_back(x(top % columns), y(top / columns), -field.base);
  mesh.vertices.emplace_back(0.0, 0.0, -field.base);
  for (int i = 0; i < around; ++i) {
    const int next = (i + 1) % around, top = border[static_cast<std::size_t>(i)];
    mesh.triangles.emplace_back(top, ground + i, ground + next);
    mesh.triangles.emplace_back(top, ground + next, border[static_cast<std::size_t>(next)]);
    mesh.triangles.emplace_back(middle, ground + next, ground + i);
  }
  return mesh;
}

}  // namespace dofusion
