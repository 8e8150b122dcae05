// The paper's evaluation: held-out scenes, one placement each, displacement or success after settling.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "diffusion/sampler.h"
#include "stability/dataset.h"
#include "stability/outcome.h"

namespace dofusion {

// One scene to place into: a stable scene with one object, the query, taken away.
struct Instance {
  Scene context;
  ObjectPtr query;
  Task task = Task::kSingle;
};

struct InstanceOptions {
  Task task = Task::kUnstructured;
  int context = 2;                     // objects besides the query; 0 for single
  std::optional<std::string> shape;    // every query is this block; otherwise the seven in turn
  int count = 100;
  std::uint64_t seed = 0;
  int threads = 1;
};

// Fresh stable scenes of the seven blocks. The query is the top of a stack, any object of an unstructured scene.
// Training sets were made with other seeds, so these scenes are held out. Throws std::invalid_argument on an unknown
// shape.
std::vector<Instance> make_instances(const InstanceOptions& options);

// Puts the query of each instance at the pose of the same index and settles.
std::vector<Outcome> settle_placements(const std::vector<Instance>& instances, const std::vector<Pose>& T_world_query,
                                       int threads, const PhysicsOptions& physics = {});

std::vector<Pose> sample_placements(const std::vector<Instance>& instances, const PlacementModel& model,
                                    std::uint64_t seed, const SamplerOptions& options);
std::vector<Pose> random_placements(const std::vector<Instance>& instances, std::uint64_t seed);

// The table `name` ("single", "stack-one", "stack-two", "unstructured") as rows: for each of the paper's blocks and
// columns the figure with its bootstrap 95 % interval, the random baseline's, and the paper's.
nlohmann::json table_rows(const std::string& name, const std::vector<Instance>& instances,
                          const std::vector<Outcome>& model, const std::vector<Outcome>& random, std::uint64_t seed);

// The rows as an aligned text table for people.
std::string format_rows(const nlohmann::json& rows);

}  // namespace dofusion
