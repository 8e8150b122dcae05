#include "stability/outcome.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dofusion {

bool is_stacked(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& before, const SettleResult& settled,
                int query) {
  if (settled.status != SettleStatus::kSettled) return false;
  bool on_context = false;
  for (const auto& [a, b] : settled.touching) {
    if (a == -1 && b == query) return false;
    on_context = on_context || a == query || b == query;
  }
  std::vector<ObjectPtr> context = objects;
  std::vector<Pose> context_before = before, context_after = settled.T_world_object;
  context.erase(context.begin() + query);
  context_before.erase(context_before.begin() + query);
  context_after.erase(context_after.begin() + query);
  return on_context && is_stable(displacement(context, context_before, context_after));
}

Outcome judge(const std::vector<double>& diameters, const std::vector<Pose>& before, const SettleResult& settled) {
  Outcome outcome;
  outcome.status = settled.status;
  outcome.initial_penetration = settled.initial_penetration;
  if (settled.status == SettleStatus::kDiverged) {
    const double inf = std::numeric_limits<double>::infinity();
    outcome.displacement = {inf, inf};
    outcome.accumulated_rotation_deg = outcome.tilt_deg = inf;
    outcome.tilted = true;
    return outcome;
  }
  const bool rests = settled.status == SettleStatus::kSettled;
  outcome.displacement = displacement(diameters, before, settled.T_world_object);
  for (const double turned : settled.turned) {
    outcome.accumulated_rotation_deg = std::max(outcome.accumulated_rotation_deg, turned * 180.0 / M_PI);
  }
  outcome.tilt_deg = largest_tilt_deg(before, settled.T_world_object);
  outcome.stable = rests && is_stable(outcome.displacement);
  outcome.quiet = rests && outcome.accumulated_rotation_deg < kQuietRotationDeg;
  outcome.tilted = outcome.tilt_deg > kTiltedDeg;
  return outcome;
}

Outcome judge(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& before, const SettleResult& settled,
              int query) {
  if (query < 0 || query >= static_cast<int>(objects.size())) {
    throw std::invalid_argument("judge: there is no object " + std::to_string(query));
  }
  Outcome outcome = judge(diameters_of(objects), before, settled);
  outcome.stacked = is_stacked(objects, before, settled, query);
  for (const auto& [first, second] : settled.touching) {
    if (first != query && second != query) continue;
    if (first == -1)
      outcome.on_table = true;
    else
      ++outcome.touches;
  }
  return outcome;
}

}  // namespace dofusion
