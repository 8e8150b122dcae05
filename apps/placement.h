// From a scene and a query to ranked, physics-checked placements.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diffusion/sampler.h"
#include "stability/metrics.h"
#include "stability/physics.h"

namespace dofusion {

struct PlacementOptions {
  int samples = 32;
  std::uint64_t seed = 0;
  int threads = 1;
  int steps = 50;                 // of the sampler
  int context = 2;                // objects that the model looks at in one sample; more are taken in turn
  std::optional<std::size_t> anchor;  // the object that every sample looks at; none: each in turn
  std::optional<Eigen::Vector2d> centre;  // world x, y where the search begins; none: amid what the sample looks at
  std::optional<Pose> start;          // T_world_query to begin at, with noise of `start_sigma`, instead of anywhere
  double start_sigma = 0.0;           // in the model's lengths and radians; 0: the model's largest
  std::vector<PoseCostPtr> guides;    // wishes that steer the sampler
  bool polish = true;             // take the pose at which a stable sample came to rest, if that moves less
  int trials = 6;                 // of each of the best candidates, with its pose disturbed by what follows
  int tried = 12;                 // candidates that are tried so
  double trial_shift = 1.5e-3;    // metres, standard deviation of each coordinate
  double trial_turn = 0.013;      // radians, of each component of a rotation vector
  PhysicsOptions physics;
};

struct Placement {
  Pose T_world_query = Pose::Identity();
  Pose T_world_sampled = Pose::Identity();  // what the model generated; the same unless polished
  SettleStatus status = SettleStatus::kDiverged;
  bool stable = false;                 // settled, and nothing moved more than 10 % and 10°
  Displacement displacement;           // the largest over all objects; infinite if the simulation diverged
  double penetration = 0.0;            // metres, deepest overlap before settling
  std::optional<double> robustness;    // share of the disturbed trials that were stable; none if not tried
  std::optional<double> stable_probability;  // over what the scene may really be (ranking.h); none if not tried
  std::vector<Pose> settled;           // context first, the query last
  std::vector<int> touches;            // context objects that the settled query touches, -1 the table
  std::vector<std::string> unmet;      // wishes that it does not meet (wishes.h)
};

// Candidates from the model, settled with the whole scene, best first: stable ones by robustness, then by how little
// moves; then the others. The same arguments give the same result on any number of threads.
std::vector<Placement> place(const Scene& scene, const ObjectPtr& query, const PlacementModel& model,
                             const PlacementOptions& options);

// The problems that the model is asked: candidate i looks at object i mod n and what is nearest to it, or at the whole
// scene if that is no more than options.context objects.
std::vector<PlacementProblem> placement_problems(const Scene& scene, const ObjectPtr& query,
                                                 const PlacementOptions& options);

// What the model's sampler is told.
SamplerOptions sampler_options(const PlacementOptions& options);

// Settles each candidate pose with the whole scene, polishes, tries and ranks.
std::vector<Placement> check_placements(const Scene& scene, const ObjectPtr& query, const std::vector<Pose>& candidates,
                                        const PlacementOptions& options);

}  // namespace dofusion
