#include "stability/mjcf_objects.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "stability/files.h"
#include "stability/mesh_rays.h"
#include "stability/mjcf_solids.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

constexpr double kInside = 1e-3;   // of the object's diameter: a geom no farther outside another adds nothing to it
constexpr double kOverlap = 1e-3;  // of the object's volume
constexpr int kLinesPerSide = 128;

struct Solid {
  int geom = 0;
  Pose T_body_geom = Pose::Identity();
  PaddedHull hull;
  TriangleMesh mesh;  // in the body's frame
};

Pose world_pose(const mjtNum* position, const mjtNum* row_major) {
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  return make_pose(Eigen::Map<const RowMajor>(row_major), Vector3d(position));
}

// How far the hull reaches out of a convex mesh, metres; negative inside.
double outside(const PaddedHull& hull, const TriangleMesh& convex) {
  double farthest = -INFINITY;
  for (const Eigen::Vector3i& t : convex.triangles) {
    const Vector3d& a = convex.vertices[t[0]];
    const Vector3d across = (convex.vertices[t[1]] - a).cross(convex.vertices[t[2]] - a);
    if (!(across.norm() > 0.0)) continue;
    const Vector3d normal = across.normalized();
    for (const Vector3d& p : hull.points) farthest = std::max(farthest, normal.dot(p - a) + hull.radius);
  }
  return farthest;
}

TriangleMesh merged(const std::vector<Solid>& solids) {
  TriangleMesh all;
  for (const Solid& solid : solids) {
    const Eigen::Vector3i first = Eigen::Vector3i::Constant(static_cast<int>(all.vertices.size()));
    all.vertices.insert(all.vertices.end(), solid.mesh.vertices.begin(), solid.mesh.vertices.end());
    for (const Eigen::Vector3i& t : solid.mesh.triangles) all.triangles.push_back(t + first);
  }
  return all;
}

// Those that are not within a larger one, in the file's order.
std::vector<Solid> without_inner(std::vector<Solid> solids) {
  const double allowed = kInside * diameter(merged(solids));
  std::stable_sort(solids.begin(), solids.end(),
                   [](const Solid& a, const Solid& b) { return volume(a.mesh) > volume(b.mesh); });
  std::vector<Solid> kept;
  for (Solid& solid : solids) {
    const bool inner = std::any_of(kept.begin(), kept.end(),
                                   [&](const Solid& other) { return outside(solid.hull, other.mesh) <= allowed; });
    if (!inner) kept.push_back(std::move(solid));
  }
  std::sort(kept.begin(), kept.end(), [](const Solid& a, const Solid& b) { return a.geom < b.geom; });
  return kept;
}

// The share of what the shells of a mesh hold together that more than one of them holds, along parallel lines.
double overlap(const TriangleMesh& shells) {
  const MeshRays rays(shells);
  const BoundingBox box = bounding_box(shells);
  const Vector3d step = (box.max - box.min) / kLinesPerSide;
  double once = 0.0, more = 0.0;
  for (int i = 0; i < kLinesPerSide; ++i) {
    for (int j = 0; j < kLinesPerSide; ++j) {
      int depth = 0;
      double from = 0.0;
      for (const RayCrossing& c :
           rays.along_x(box.min.y() + (i + 0.5) * step.y(), box.min.z() + (j + 0.5) * step.z())) {
        if (depth > 0) once += c.x - from;
        if (depth > 1) more += c.x - from;
        depth += c.change;
        from = c.x;
      }
    }
  }
  return once > 0.0 ? more / once : 0.0;
}

// Looks for what a scene of free objects on a table has no place for, and makes the objects.
class Converter {
 public:
  Converter(const mjModel& model, const mjData& data, const std::string& path)
      : model_(model), data_(data), path_(path) {}

  std::vector<FreeObject> convert() const {
    check_whole();
    check_table();
    std::vector<FreeObject> objects;
    for (int body = 1; body < model_.nbody; ++body) {
      if (!body_moves(model_, body)) continue;
      const int root = model_.body_weldid[body];
      check_free(root);
      if (body == root) objects.push_back(make(root));
    }
    return objects;
  }

 private:
  InputError refused(const std::string& why) const {
    return InputError(path_ + ": cannot become a scene of objects on a table: " + why);
  }
  std::string quoted(int body) const { return "'" + body_name(model_, body) + "'"; }

  void check_whole() const {
    if (model_.neq > 0) throw refused("it has constraints between bodies (<equality>)");
    if (model_.nu > 0) throw refused("it has actuators");
    if (model_.ntendon > 0) throw refused("it has tendons");
    const Vector3d g(model_.opt.gravity);
    if (!(g.z() < 0.0) || g.head<2>().norm() > 1e-6 * g.norm() || (model_.opt.disableflags & mjDSBL_GRAVITY) != 0) {
      throw refused("its gravity does not point down");
    }
  }

  bool is_table(int geom) const {
    if (model_.geom_type[geom] != mjGEOM_PLANE) return false;
    const Pose T_world_geom = world_pose(data_.geom_xpos + 3 * geom, data_.geom_xmat + 9 * geom);
    const Vector3d up = T_world_geom.linear().col(2);
    return up.z() > 0.0 && up.head<2>().norm() < 1e-6 && std::abs(T_world_geom.translation().dot(up)) < 1e-6;
  }

  void check_table() const {
    bool found = false;
    for (int geom = 0; geom < model_.ngeom; ++geom) {
      const int body = model_.geom_bodyid[geom];
      if (body_moves(model_, body) || !is_touchable(model_, geom)) continue;
      if (!is_table(geom)) {
        throw refused("'" + (body == 0 ? std::string("world") : body_name(model_, body)) +
                      "' is fixed and has a geom other than a plane at z = 0");
      }
      found = true;
    }
    if (!found) throw refused("it has no plane at z = 0");
  }

  void check_free(int root) const {
    const bool free = model_.body_parentid[root] == 0 && model_.body_jntnum[root] == 1 &&
                      model_.jnt_type[model_.body_jntadr[root]] == mjJNT_FREE;
    if (!free) throw refused(quoted(root) + " moves on a joint that is not free");
  }

  std::vector<Solid> solids_of(int root) const {
    const Pose T_world_body = world_pose(data_.xpos + 3 * root, data_.xmat + 9 * root);
    std::vector<Solid> solids;
    for (int geom = 0; geom < model_.ngeom; ++geom) {
      if (model_.body_weldid[model_.geom_bodyid[geom]] != root || !is_touchable(model_, geom)) continue;
      Solid solid;
      solid.geom = geom;
      solid.T_body_geom = T_world_body.inverse() * world_pose(data_.geom_xpos + 3 * geom, data_.geom_xmat + 9 * geom);
      solid.hull = padded_hull(model_, geom, solid.T_body_geom);
      solid.mesh = geom_mesh(model_, geom, solid.T_body_geom);
      solids.push_back(std::move(solid));
    }
    if (solids.empty()) throw refused("nothing of " + quoted(root) + " can be touched");
    return solids;
  }

  ObjectPtr primitive(const std::string& name, int geom) const {
    const mjtNum* size = model_.geom_size + 3 * geom;
    switch (model_.geom_type[geom]) {
      case mjGEOM_BOX:
        return make_box(name, 2.0 * Vector3d(size));
      case mjGEOM_CYLINDER:
        return make_cylinder(name, size[0], 2.0 * size[1]);
      case mjGEOM_SPHERE:
        return make_sphere(name, size[0]);
      default:
        return nullptr;
    }
  }

  FreeObject make(int root) const {
    const std::string name = body_name(model_, root);
    try {
      const std::vector<Solid> solids = without_inner(solids_of(root));
      if (solids.size() == 1) {
        if (const ObjectPtr object = primitive(name, solids[0].geom)) return {object, root, solids[0].T_body_geom};
      }
      std::vector<TriangleMesh> parts;
      if (solids.size() > 1) {
        for (const Solid& solid : solids) parts.push_back(solid.mesh);
      }
      const TriangleMesh mesh = merged(solids);
      const double share = parts.empty() ? 0.0 : overlap(mesh);
      if (share > kOverlap) {
        throw refused("geoms of " + quoted(root) + " overlap by " + std::to_string(100.0 * share) +
                      " % of its volume, which would count twice");
      }
      const ObjectAndOffset made = make_object(name, mesh, parts);
      return {made.object, root, make_pose(Eigen::Matrix3d::Identity(), made.origin)};
    } catch (const std::invalid_argument& e) {  // a flat mesh
      throw refused(quoted(root) + ": " + one_line(e.what()));
    }
  }

  const mjModel& model_;
  const mjData& data_;
  const std::string& path_;
};

}  // namespace

bool body_moves(const mjModel& model, int body) { return model.body_jntnum[model.body_weldid[body]] > 0; }

std::vector<FreeObject> free_objects(const mjModel& model, const mjData& data, const std::string& path) {
  return Converter(model, data, path).convert();
}

}  // namespace dofusion
