// Which parts of a recovered mesh the cameras have seen.
#pragma once

#include <vector>

#include "perception/recovery.h"
#include "perception/views.h"

namespace dofusion {

// For each triangle of the object's mesh the share (0 … 1) of it that faces a camera and that a reading shows, to three
// sigmas of the view's table along the ray and `slack` (metres) across the surface; over several views the largest. 0:
// nobody has seen that it is there. The views' world is the object's (on_common_table()); their labels are not used.
std::vector<float> seen_shares(const RecoveredObject& object, const std::vector<View>& views, double slack = 0.002);

}  // namespace dofusion
