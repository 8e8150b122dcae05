// What recovery needs to know of an object of the library, computed once.
#pragma once

#include <vector>

#include "stability/mesh_symmetry.h"
#include "stability/resting_poses.h"
#include "stability/scene.h"
#include "stability/sdf.h"

namespace dofusion {

// A way to lie on a level surface. Turned about z by any yaw and moved in x and y it keeps resting.
struct DistinctRest {
  RestingPose pose;
  double yaw_period = 0.0;  // radians after which the object looks the same
};

struct ObjectModel {
  explicit ObjectModel(const ObjectPtr& object);

  ObjectPtr object;
  std::vector<Eigen::Matrix3d> symmetries;                      // the identity first
  std::vector<PlanarFace> faces;                                // all large ones
  std::vector<PlanarFace> distinct;                             // one of each class
  std::vector<DistinctRest> resting;                            // one of each class
  std::vector<std::pair<Eigen::Vector3d, double>> half_spaces;  // n·p <= d, of a convex object; else empty
  std::vector<Eigen::Vector3d> probes;                          // points on the surface, corners and edges first
  MeshDistance distance;
  double radius = 0.0;  // metres from the origin to the farthest vertex
};

// Metres from one object's surface to the other's, negative if they overlap (then about how deep). Probes decide, so
// that an overlap thinner than their spacing (an eighth of the diameter) away from corners and edges may be missed.
double clearance(const ObjectModel& a, const Pose& T_world_a, const ObjectModel& b, const Pose& T_world_b);

// How deep the objects overlap, metres; 0 if they do not. Much faster than clearance() for convex objects.
double overlap(const ObjectModel& a, const Pose& T_world_a, const ObjectModel& b, const Pose& T_world_b);

// The height of the object's lowest point above the table.
double lowest_point(const ObjectModel& model, const Pose& T_world_object);

}  // namespace dofusion
