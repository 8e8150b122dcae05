// Forward simulation of a scene in MuJoCo until everything rests.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stability/scene.h"

namespace dofusion {

struct PhysicsOptions {
  double density = 600.0;       // kg/m3, of wood
  double friction = 0.8;        // sliding, object-object and object-table
  double timestep = 0.004;      // seconds
  double time_limit = 4.0;      // simulated seconds until a scene that still moves is given up
  // A scene rests when every object has stayed this near to one pose for `rest_time` simulated seconds. Positions, not
  // speeds: a face on a face may tremble for ever within a few millionths of its size.
  double rest_time = 0.2;
  double rest_shift = 5e-4;     // of the object's diameter
  double rest_turn = 1e-3;      // radians
};

// kDiverged: a state became infinite, or there were more contacts than MuJoCo had room for.
enum class SettleStatus { kSettled, kTimeLimit, kDiverged };
std::string to_string(SettleStatus status);

struct SettleResult {
  SettleStatus status = SettleStatus::kDiverged;
  std::vector<Pose> T_world_object;           // at the end; the input poses if the simulation diverged
  double seconds = 0.0;                       // simulated
  double initial_penetration = 0.0;           // deepest overlap at the start, metres, >= 0, table included
  std::vector<std::pair<int, int>> touching;  // pairs i < j in contact at the end; the table is -1, as first
};

// The compiled MuJoCo model of one combination of objects on a table. Models are expensive to build (milliseconds)
// and cheap to keep. Not to be shared between threads.
class Simulator {
 public:
  Simulator(std::vector<ObjectPtr> objects, const PhysicsOptions& options = {});
  ~Simulator();
  Simulator(Simulator&&) noexcept;
  Simulator& operator=(Simulator&&) noexcept;

  // From rest at the given poses (one per object) until every object rests. Throws std::invalid_argument if the
  // number of poses is wrong or a pose is not finite.
  SettleResult settle(const std::vector<Pose>& T_world_object) const;

  // As settle, and also records the poses `frames_per_second` times a simulated second.
  SettleResult settle(const std::vector<Pose>& T_world_object, double frames_per_second,
                      std::vector<std::vector<Pose>>* frames) const;

  const std::vector<ObjectPtr>& objects() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Simulators by combination of objects, built when first asked for. The least recently used go when there are more
// than `capacity`. One per thread.
class SimulatorCache {
 public:
  explicit SimulatorCache(const PhysicsOptions& options = {}, std::size_t capacity = 512);
  ~SimulatorCache();
  const Simulator& get(const std::vector<ObjectPtr>& objects);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dofusion
