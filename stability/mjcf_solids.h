// The solids that MuJoCo takes a model's geoms for. Private to stability.
#pragma once

#include <string>
#include <vector>

#include "stability/mesh.h"
#include "stability/mujoco_model.h"
#include "stability/pose.h"

namespace dofusion {

// What something can touch; not what is only shown.
bool is_touchable(const mjModel& model, int geom);

// The body's name, printable; "body <id>" if it has none.
std::string body_name(const mjModel& model, int body);

// A convex solid: the hull of `points`, all around by `radius` larger. Exact but for cylinders and ellipsoids, whose
// points lie on the surface.
struct PaddedHull {
  std::vector<Eigen::Vector3d> points;
  double radius = 0.0;
};
// Throws std::invalid_argument for planes and height fields.
PaddedHull padded_hull(const mjModel& model, int geom, const Pose& T_body_geom);

// The solid's surface, closed. A mesh geom is its convex hull, since that is what MuJoCo collides. Round ones are
// tessellated, their corners on the surface: it lies at most 0.0012 radii (cylinders) or 0.005 radii (others) inside
// the round one. Throws as padded_hull, or if a mesh is flat.
TriangleMesh geom_mesh(const mjModel& model, int geom, const Pose& T_body_geom);

// The largest distance between two points of the body's geoms that can be touched, or of all its geoms if none can.
// Exact for one geom, and for any number of boxes, meshes, spheres and capsules; with cylinders or ellipsoids among
// several, up to 0.0012 or 0.005 of their radii too small. Infinite with a plane. A height field counts as its box.
double body_diameter(const mjModel& model, int body);

}  // namespace dofusion
