// How a scene moves while it settles with the query at a placement: for pictures, not for judging.
#pragma once

#include <vector>

#include "apps/placement.h"

namespace dofusion {

struct SettlingMotion {
  std::vector<double> seconds;                    // (F) simulated, ascending, the first 0
  std::vector<std::vector<Pose>> T_world_object;  // (F, context and the query last)
};

struct MotionOptions {
  double frames_per_second = 25.0;  // of simulated time
  std::size_t most = 32;            // placements that are simulated, the first ones; the others get their start alone
  double reach = 10.0;              // metres from the origin: where a simulation fails, frames beyond are left out
};

// One motion per placement, in their order, from T_world_query on with the context at rest: the simulation that
// check_placements judged by. The same on any number of threads.
std::vector<SettlingMotion> settling_motions(const Scene& scene, const ObjectPtr& query,
                                             const std::vector<Placement>& placements, const PhysicsOptions& physics,
                                             int threads, const MotionOptions& options = {});

}  // namespace dofusion
