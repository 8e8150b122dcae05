#include "stability/mjcf_solids.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "stability/convex_hull.h"
#include "stability/point_tree.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

Vector3d size_of(const mjModel& model, int geom) { return Vector3d(model.geom_size + 3 * geom); }

Pose local_pose(const mjModel& model, int geom) {
  PoseArray pose;
  std::copy_n(model.geom_pos + 3 * geom, 3, pose.begin());
  std::copy_n(model.geom_quat + 4 * geom, 4, pose.begin() + 3);
  return from_array(pose);
}

std::vector<Vector3d> mesh_points(const mjModel& model, int geom) {
  const int mesh = model.geom_dataid[geom];
  const float* vertices = model.mesh_vert + 3 * model.mesh_vertadr[mesh];
  std::vector<Vector3d> points;
  for (int i = 0; i < model.mesh_vertnum[mesh]; ++i) {
    points.push_back(Eigen::Map<const Eigen::Vector3f>(vertices + 3 * i).cast<double>());
  }
  return points;
}

std::vector<Vector3d> height_field_box(const mjModel& model, int geom) {
  const mjtNum* size = model.hfield_size + 4 * model.geom_dataid[geom];  // half x, half y, top, base
  const Vector3d edges(2.0 * size[0], 2.0 * size[1], size[2] + size[3]);
  return translated(box_mesh(edges), {0, 0, (size[2] - size[3]) / 2.0}).vertices;
}

PaddedHull own_hull(const mjModel& model, int geom) {
  const Vector3d size = size_of(model, geom);
  switch (model.geom_type[geom]) {
    case mjGEOM_SPHERE:
      return {{Vector3d::Zero()}, size.x()};
    case mjGEOM_CAPSULE:
      return {{{0, 0, -size.y()}, {0, 0, size.y()}}, size.x()};
    case mjGEOM_CYLINDER:
      return {cylinder_mesh(size.x(), 2.0 * size.y()).vertices, 0.0};
    case mjGEOM_ELLIPSOID:
      return {scaled(sphere_mesh(1.0), size).vertices, 0.0};
    case mjGEOM_BOX:
      return {box_mesh(2.0 * size).vertices, 0.0};
    case mjGEOM_MESH:
      return {mesh_points(model, geom), 0.0};
    default:
      throw std::invalid_argument("a plane or height field is no solid");
  }
}

// Half a sphere at either end.
TriangleMesh capsule_mesh(double radius, double half_length) {
  std::vector<Vector3d> points;
  for (const Vector3d& p : sphere_mesh(radius).vertices) {
    if (p.z() > -1e-9 * radius) points.emplace_back(p + half_length * Vector3d::UnitZ());
    if (p.z() < 1e-9 * radius) points.emplace_back(p - half_length * Vector3d::UnitZ());
  }
  return convex_hull(points);
}

TriangleMesh own_mesh(const mjModel& model, int geom) {
  const Vector3d size = size_of(model, geom);
  switch (model.geom_type[geom]) {
    case mjGEOM_SPHERE:
      return sphere_mesh(size.x());
    case mjGEOM_CAPSULE:
      return capsule_mesh(size.x(), size.y());
    case mjGEOM_CYLINDER:
      return cylinder_mesh(size.x(), 2.0 * size.y());
    case mjGEOM_ELLIPSOID:
      return scaled(sphere_mesh(1.0), size);
    case mjGEOM_BOX:
      return box_mesh(2.0 * size);
    case mjGEOM_MESH:
      return convex_hull(mesh_points(model, geom));
    default:
      throw std::invalid_argument("a plane or height field is no solid");
  }
}

double diameter_of(const std::vector<PaddedHull>& hulls) {
  std::vector<Vector3d> bare;
  std::vector<std::pair<Vector3d, double>> balls;
  for (const PaddedHull& hull : hulls) {
    for (const Vector3d& p : hull.points) {
      if (hull.radius > 0.0) balls.emplace_back(p, hull.radius);
    }
    if (hull.radius == 0.0) bare.insert(bare.end(), hull.points.begin(), hull.points.end());
  }
  double largest = bare.empty() ? 0.0 : PointTree(bare).diameter();
  for (const auto& [centre, radius] : balls) {
    for (const auto& [other, other_radius] : balls) {
      largest = std::max(largest, (centre - other).norm() + radius + other_radius);
    }
    for (const Vector3d& p : bare) largest = std::max(largest, (centre - p).norm() + radius);
  }
  return largest;
}

}  // namespace

bool is_touchable(const mjModel& model, int geom) {
  if (model.geom_contype[geom] != 0 || model.geom_conaffinity[geom] != 0) return true;
  const auto in = [&](const int* geoms) { return std::find(geoms, geoms + model.npair, geom) != geoms + model.npair; };
  return in(model.pair_geom1) || in(model.pair_geom2);
}

std::string body_name(const mjModel& model, int body) {
  const char* name = mj_id2name(&model, mjOBJ_BODY, body);
  const std::string printable = name == nullptr ? std::string() : one_line(name);
  return printable.empty() ? "body " + std::to_string(body) : printable;
}

PaddedHull padded_hull(const mjModel& model, int geom, const Pose& T_body_geom) {
  PaddedHull hull = own_hull(model, geom);
  for (Vector3d& p : hull.points) p = T_body_geom * p;
  return hull;
}

TriangleMesh geom_mesh(const mjModel& model, int geom, const Pose& T_body_geom) {
  TriangleMesh mesh = own_mesh(model, geom);
  for (Vector3d& v : mesh.vertices) v = T_body_geom * v;
  return mesh;
}

double body_diameter(const mjModel& model, int body) {
  const int first = model.body_geomadr[body], end = first + model.body_geomnum[body];
  std::vector<int> all, touchable;
  for (int geom = first; geom < end; ++geom) {
    all.push_back(geom);
    if (is_touchable(model, geom)) touchable.push_back(geom);
  }
  std::vector<PaddedHull> hulls;
  for (const int geom : touchable.empty() ? all : touchable) {
    if (model.geom_type[geom] == mjGEOM_PLANE) return std::numeric_limits<double>::infinity();
    const Pose T_body_geom = local_pose(model, geom);
    if (model.geom_type[geom] == mjGEOM_HFIELD) {
      hulls.push_back({height_field_box(model, geom), 0.0});
      for (Vector3d& p : hulls.back().points) p = T_body_geom * p;
    } else {
      hulls.push_back(padded_hull(model, geom, T_body_geom));
    }
  }
  return diameter_of(hulls);
}

}  // namespace dofusion
