// A running MuJoCo simulation of some bodies of interest. Private to stability: Simulator and MjcfScene stand on it.
#pragma once

#include <vector>

#include "stability/mujoco_model.h"
#include "stability/physics.h"
#include "stability/pose.h"

namespace dofusion {

class Simulation {
 public:
  struct Body {
    int id = 0;             // in the model
    double diameter = 0.0;  // metres
  };
  // `bodies` are those whose poses count; any others move along unseen.
  Simulation(ModelPtr model, std::vector<Body> bodies);

  // To the model's own initial state, at rest, or to one of its keyframes.
  void reset(int keyframe = -1);
  // At rest with the bodies, which have free joints or are MuJoCo's mocap bodies, at these poses.
  void start_at(const std::vector<Pose>& T_world_body);
  struct Recording {
    double frames_per_second = 0.0;
    std::vector<std::vector<Pose>>* frames = nullptr;  // may be null: nothing is recorded
  };
  // From the state of the last reset or start_at until every body rests, as PhysicsOptions says.
  SettleResult settle(const PhysicsOptions& options, const Loads& loads, const RunLimits& limits,
                      const Recording& recording);

  // Of each body: position of its centre of mass, orientation of its frame.
  std::vector<Pose> poses();

  // Brings the poses of cameras and bodies in data() up to date.
  void place_cameras();

  const mjModel& model() const { return *model_; }
  const mjData& data() const { return *data_; }

 private:
  struct RestWatch;
  void apply(const Loads& loads);
  void record(const Recording& recording);
  double deepest_penetration() const;
  void find_near_contacts();
  std::vector<std::pair<int, int>> touching();

  ModelPtr model_;
  DataPtr data_;
  std::vector<Body> bodies_;
};

}  // namespace dofusion
