// How firmly an object stands in a settled scene.
#pragma once

#include <vector>

#include "stability/physics.h"

namespace dofusion {

struct PushOptions {
  int directions = 8;         // horizontal, evenly spread
  double most = 2.0;          // largest force tried, in weights of the object
  double resolution = 0.005;  // of the answer, in weights
  double seconds = 0.5;       // for which the force acts
};

// The largest horizontal force at the object's centre of mass, in units of its weight, that it withstands whatever its
// direction: while the force acts nothing in the scene moves more than 10 % of its diameter or 10 degrees. A block
// alone on the table: the smaller of the friction and of what tips it. `options.most` if no force tried moves it, 0 if
// the scene does not stand by itself.
double largest_push(const Simulator& simulator, const std::vector<Pose>& T_world_object, int object,
                    const PushOptions& options = {});

// The upside-down test: gravity is reversed for the object and for whatever rests on it, the others are fixed. True if
// within half a second the object touches none of those, nor the table. False tells that it is caught: hooked in,
// or driven into its neighbours.
bool comes_off_upside_down(const Simulator& simulator, const std::vector<Pose>& T_world_object, int object);

}  // namespace dofusion
