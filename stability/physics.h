// Forward simulation of a scene in MuJoCo until everything rests.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "stability/scene.h"

namespace dofusion {

// Chosen by measurement: stability/README.md, "Settings".
struct PhysicsOptions {
  double density = 600.0;          // kg/m3, of wood
  double friction = 0.8;           // sliding, object-object and object-table
  double rolling_friction = 5e-4;  // metres, of cylinders and spheres
  double timestep = 0.004;         // seconds
  double contact_time =
      0.01;                 // seconds in which a contact's overlap is undone; stiffness, so not a multiple of timestep
  double time_limit = 4.0;  // simulated seconds until a scene that still moves is given up
  // A scene rests when every object has stayed this near to one pose for `rest_time` simulated seconds. Positions, not
  // speeds: a face on a face may tremble for ever within a few millionths of its size.
  double rest_time = 0.1;
  double rest_shift = 5e-4;  // of the object's diameter
  double rest_turn = 1e-3;   // radians
};

// kDiverged: a state became infinite, or there were more contacts than MuJoCo had room for.
enum class SettleStatus { kSettled, kTimeLimit, kDiverged };
std::string to_string(SettleStatus status);

// What acts on the objects beside their weight on the table.
struct Loads {
  Eigen::Vector3d gravity{0.0, 0.0, -9.81};  // m/s2, world
  std::vector<Eigen::Vector3d> forces;       // newtons at each object's centre of mass, world; empty: none
  double forces_until =
      std::numeric_limits<double>::infinity();  // simulated seconds; rest is judged after that if finite
};

struct RunLimits {
  double seconds = 4.0;             // simulated
  bool until_rest = true;           // stops once everything rests; otherwise runs on, and the status is kTimeLimit
  std::function<bool()> stop = {};  // asked before every step; true ends the run as if the time were over
};

struct SettleResult {
  SettleStatus status = SettleStatus::kDiverged;
  std::vector<Pose> T_world_object;           // at the end; the input poses if the simulation diverged
  std::vector<double> turned;                 // per object, radians: angles of rotation summed over all steps
  double seconds = 0.0;                       // simulated
  double initial_penetration = 0.0;           // deepest overlap at the start, metres, >= 0, table included
  std::vector<std::pair<int, int>> touching;  // pairs i < j at most 0.1 mm apart at the end; the table is -1, as first
};

// The compiled MuJoCo model of one combination of objects on a table. Models are expensive to build (milliseconds)
// and cheap to keep. Not to be shared between threads.
class Simulator {
 public:
  // `fixed`: objects that are part of the surroundings and stay where they start; empty: none. Throws
  // std::invalid_argument if it is neither empty nor one entry per object.
  Simulator(std::vector<ObjectPtr> objects, const PhysicsOptions& options = {}, std::vector<bool> fixed = {});
  ~Simulator();
  Simulator(Simulator&&) noexcept;
  Simulator& operator=(Simulator&&) noexcept;

  // From rest at the given poses (one per object) until every object rests or PhysicsOptions::time_limit is over.
  // Throws std::invalid_argument if the number of poses is wrong or a pose is not finite.
  SettleResult settle(const std::vector<Pose>& T_world_object) const;

  // As settle, and also records the poses `frames_per_second` times a simulated second.
  SettleResult settle(const std::vector<Pose>& T_world_object, double frames_per_second,
                      std::vector<std::vector<Pose>>* frames) const;

  // The same under loads, within other limits; throws as well if the number of loads is wrong.
  SettleResult run(const std::vector<Pose>& T_world_object, const Loads& loads, const RunLimits& limits) const;

  const std::vector<ObjectPtr>& objects() const;
  const PhysicsOptions& options() const;

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
  const Simulator& get(const std::vector<ObjectPtr>& objects, const std::vector<bool>& fixed = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dofusion
