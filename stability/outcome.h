// What became of a placement once its scene was let go: the paper's metrics and those of neighbouring work.
#pragma once

#include <vector>

#include "stability/metrics.h"
#include "stability/physics.h"

namespace dofusion {

// Of a scene in which the object `query` was placed. Largest: over all objects, query and context.
struct Outcome {
  SettleStatus status = SettleStatus::kDiverged;
  Displacement displacement;            // the paper's; infinite if the simulation diverged, as the next two
  double accumulated_rotation_deg = 0;  // largest sum of rotation angles over all steps
  double tilt_deg = 0;                  // largest angle by which an object's upright has turned
  double initial_penetration = 0;       // metres, deepest overlap at the start, table included
  bool stable = false;                  // settled, and nothing moved more than 10 % of its diameter and 10 degrees
  bool quiet = false;                   // settled, and accumulated rotation below 10 degrees (UOP-Net's success)
  bool tilted = false;                  // something ended tilted by more than 20 degrees
  bool stacked = false;                 // see is_stacked
  bool on_table = false;                // the query touches the table at the end
  int touches = 0;                      // context objects that the query touches at the end
};

// The stacking success: the scene settled, every context object stayed within 10 % and 10 degrees, and the query rests
// on context objects alone, not on the table.
bool is_stacked(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& before, const SettleResult& settled,
                int query);

// Of bodies of these diameters, metres; without a query nothing is stacked. Throws std::invalid_argument unless there
// is one pose per body.
Outcome judge(const std::vector<double>& diameters, const std::vector<Pose>& before, const SettleResult& settled);

// Throws std::invalid_argument unless there is one pose per object and `query` is one of them.
Outcome judge(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& before, const SettleResult& settled,
              int query);

}  // namespace dofusion
