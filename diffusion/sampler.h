// Placements from a trained model: the reverse process of the paper's equation (2).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diffusion/config.h"
#include "diffusion/guidance.h"
#include "diffusion/network.h"
#include "stability/scene.h"

namespace dofusion {

// Where a query is to be placed. Candidates for one scene are problems that differ in their seed.
struct PlacementProblem {
  Scene context;  // may be empty: the query alone on the table
  ObjectPtr query;
  std::uint64_t seed = 0;                            // all randomness of this problem
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // where in x, y the noise is centred at the start, metres
  std::optional<Pose> start;  // begin at this pose plus noise of SamplerOptions::start_sigma instead of from noise
  std::vector<PoseCostPtr> guides;  // wishes; after every step the clean pose goes towards them, the less the smaller
                                    // the noise is
};

// Mean position of the context's objects; zero without any.
Eigen::Vector2d default_centre(const Scene& context);

struct SamplerOptions {
  int steps = 50;  // network calls
  int points = 0;  // of each cloud; 0: as in training. Even
  int threads = 1;
  double start_sigma = 0.0;  // noise scale at the start, normalised; 0: the model's largest
  // How much of each step's noise is fresh; 0 is a deterministic process. 1 is equation (2): it follows a network that
  // errs best, but of the poses that a mode allows it takes the ones near its middle. What keeps the density's spread is
  // ancestral sampling, sqrt(1 - r^2) for steps that shrink the noise by a factor r.
  double freshness = 1.0;
};

class PlacementModel {
 public:
  // Reads a model file. Throws InputError naming the file and what is wrong with it.
  static PlacementModel load(const std::string& path);

  // A model from parameters in memory (flat, as Network's).
  PlacementModel(const ModelConfig& config, const std::vector<float>& parameters);
  // A network of one's own that takes the inputs that `config` describes; its parameters are set.
  PlacementModel(const ModelConfig& config, std::unique_ptr<Network> network);
  ~PlacementModel();
  PlacementModel(PlacementModel&&) noexcept;
  PlacementModel& operator=(PlacementModel&&) noexcept;

  // One T_world_query per problem. A problem's result depends on the problem and the options only, not on the others
  // nor on the number of threads. Throws std::invalid_argument if a pose is not finite, a query is missing, or the
  // options make no sense.
  std::vector<Pose> sample(const std::vector<PlacementProblem>& problems, const SamplerOptions& options = {}) const;

  const ModelConfig& config() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dofusion
