// The faces a solid can rest on.
#pragma once

#include <vector>

#include "stability/mesh.h"

namespace dofusion {

struct RestingPose {
  Eigen::Matrix3d R_world_object;  // turns the face down, with some yaw
  double height = 0.0;             // of the centre of mass above the support, metres
  double margin = 0.0;             // from the centre of mass's foot to the nearest edge of the face, metres, > 0
};

// Every face of the convex hull of `mesh` on which the solid stands still: the foot of the centre of mass lies inside
// the face by more than `min_margin` times the mesh's extent. The mesh's frame has its origin at the centre of mass.
std::vector<RestingPose> resting_poses(const TriangleMesh& mesh, double min_margin = 1e-3);

}  // namespace dofusion
