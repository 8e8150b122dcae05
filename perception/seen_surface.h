// Which parts of a recovered mesh the cameras have seen.
#pragma once

#include <vector>

#include "perception/shape_fit.h"

namespace dofusion {

// For each triangle the share (0 … 1) of it that faces a camera and that a reading shows, to three sigmas along the ray
// and `slack` (metres) across the surface; over several views the largest. 0: nobody has seen that it is there.
std::vector<float> seen_shares(const TriangleMesh& mesh, const Pose& T_world_object, const ShapeEvidence& evidence,
                               double slack);

}  // namespace dofusion
