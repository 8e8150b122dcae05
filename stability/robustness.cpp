#include "stability/robustness.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "stability/metrics.h"

namespace dofusion {
namespace {

constexpr double kGravity = 9.81;
constexpr double kUpsideDownSeconds = 0.5;

void check_object(const Simulator& simulator, int object) {
  if (object < 0 || object >= static_cast<int>(simulator.objects().size())) {
    throw std::invalid_argument("there is no object " + std::to_string(object) + " in the scene");
  }
}

// Simulates for a fixed time, whether or not anything rests.
SettleResult run_for(const Simulator& simulator, const std::vector<Pose>& poses, const Loads& loads, double seconds) {
  RunLimits limits;
  limits.seconds = seconds;
  limits.until_rest = false;
  return simulator.run(poses, loads, limits);
}

bool withstands(const Simulator& simulator, const std::vector<Pose>& poses, int object, double weights, double azimuth,
                double seconds) {
  const auto& objects = simulator.objects();
  const double weight = simulator.options().density * objects[object]->volume * kGravity;
  Loads loads;
  loads.forces.assign(objects.size(), Eigen::Vector3d::Zero());
  loads.forces[object] = weights * weight * Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0.0);
  const SettleResult result = run_for(simulator, poses, loads, seconds);
  return result.status != SettleStatus::kDiverged && is_stable(displacement(objects, poses, result.T_world_object));
}

// The object and all that stands on it, directly or by way of others: what touches it from above.
std::vector<bool> carried_with(int object, const std::vector<Pose>& poses,
                               const std::vector<std::pair<int, int>>& touching) {
  std::vector<bool> carried(poses.size(), false);
  carried[object] = true;
  const auto height = [&](int i) { return poses[i].translation().z(); };
  for (bool grown = true; grown;) {
    grown = false;
    for (const auto& [a, b] : touching) {
      if (a < 0 || carried[a] == carried[b]) continue;
      const int below = carried[a] ? a : b, above = carried[a] ? b : a;
      if (height(above) <= height(below)) continue;
      carried[above] = grown = true;
    }
  }
  return carried;
}

}  // namespace

double largest_push(const Simulator& simulator, const std::vector<Pose>& T_world_object, int object,
                    const PushOptions& options) {
  check_object(simulator, object);
  double held = options.most;  // withstood in every direction so far
  for (int k = 0; k < options.directions; ++k) {
    const double azimuth = 2.0 * M_PI * k / options.directions;
    const auto stands = [&](double weights) {
      return withstands(simulator, T_world_object, object, weights, azimuth, options.seconds);
    };
    if (stands(held)) continue;
    double low = 0.0, high = held;
    while (high - low > options.resolution) {
      const double middle = (low + high) / 2.0;
      (stands(middle) ? low : high) = middle;
    }
    held = low;
  }
  return held;
}

bool comes_off_upside_down(const Simulator& simulator, const std::vector<Pose>& T_world_object, int object) {
  check_object(simulator, object);
  // One step tells who touches whom.
  const SettleResult contacts = run_for(simulator, T_world_object, {}, simulator.options().timestep);
  const std::vector<bool> carried = carried_with(object, T_world_object, contacts.touching);
  std::vector<bool> fixed;
  for (const bool moves : carried) fixed.push_back(!moves);
  Loads loads;
  loads.gravity.z() = kGravity;
  const Simulator upside_down(simulator.objects(), simulator.options(), fixed);
  const SettleResult result = run_for(upside_down, T_world_object, loads, kUpsideDownSeconds);
  if (result.status == SettleStatus::kDiverged) return false;
  return std::none_of(result.touching.begin(), result.touching.end(), [&](const auto& pair) {
    const int other = pair.first == object ? pair.second : pair.second == object ? pair.first : object;
    return other != object && (other < 0 || !carried[other]);
  });
}

}  // namespace dofusion
