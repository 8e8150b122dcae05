// The paper's evaluation: held-out scenes, one placement each, displacement or success after settling; and how varied
// the placements are. The tables of it: evaluation_tables.h.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diffusion/sampler.h"
#include "stability/dataset.h"
#include "stability/generation.h"
#include "stability/outcome.h"

namespace dofusion {

// One scene to place into: a stable scene with one object, the query, taken away.
struct Instance {
  Scene context;
  ObjectPtr query;
  Task task = Task::kSingle;
  Pose T_world_query = Pose::Identity();  // where it was taken from
  bool context_stands = true;             // without it nothing of the context moves more than 10 % and 10 degrees
};

struct InstanceOptions {
  Task task = Task::kUnstructured;
  int context = 2;  // objects besides the query; 0 for single
  ShapeFamily shapes = ShapeFamily::kBlocks;
  std::optional<std::string> shape;  // every query is this block; otherwise blocks are queries in turn, general objects
                                     // as they come
  int count = 100;
  std::uint64_t seed = 0;
  int threads = 1;
};

// Fresh stable scenes. The query is the top of a stack, any object of an unstructured scene. Training sets were made
// with other seeds, so these scenes are held out. Throws std::invalid_argument on an unknown shape, or one that the
// family does not have.
std::vector<Instance> make_instances(const InstanceOptions& options);

// Up to `count` instances of scenes that there are, each with a random object as the query (the top of a stack), spread
// evenly over the scenes.
std::vector<Instance> instances_of(const std::vector<SceneDataset>& datasets, int count, std::uint64_t seed);

// Puts the query of each instance at the pose of the same index and settles.
std::vector<Outcome> settle_placements(const std::vector<Instance>& instances, const std::vector<Pose>& T_world_query,
                                       int threads, const PhysicsOptions& physics = {});

// One problem an instance, with seeds of its own; the noise is centred at the context.
std::vector<PlacementProblem> placement_problems(const std::vector<Instance>& instances, std::uint64_t seed);

std::vector<Pose> sample_placements(const std::vector<Instance>& instances, const PlacementModel& model,
                                    std::uint64_t seed, const SamplerOptions& options);
std::vector<Pose> random_placements(const std::vector<Instance>& instances, std::uint64_t seed);

// The poses that the queries were taken from.
std::vector<Pose> held_out_placements(const std::vector<Instance>& instances);

// How the query stands at the end, by what it touches: the table or not, and no, one or several context objects.
inline constexpr int kContactModes = 6;
int contact_mode(const Outcome& outcome);
std::string contact_mode_name(int mode);

// Shannon entropy of the contact modes of the stable outcomes, bits; 0 without any. A model that always answers the
// same has 0.
double contact_entropy(const std::vector<Outcome>& outcomes);

// Of the instances whose context falls without the query, the share in which it stands with it; NaN without any.
double support_share(const std::vector<Instance>& instances, const std::vector<Outcome>& outcomes);

}  // namespace dofusion
