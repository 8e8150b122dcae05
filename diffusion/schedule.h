// Noise scales: which ones training sees and which ones the reverse process visits.
#pragma once

#include <vector>

#include "diffusion/config.h"
#include "stability/random.h"

namespace dofusion {

// The paper's discrete scales sigma_1 < … < sigma_T, geometric from sigma_min to sigma_max.
std::vector<double> discrete_schedule(const ModelConfig& config);

// A noise scale for training: uniform over the discrete ones (paper), log-uniform over [sigma_min, sigma_max]
// (default).
double draw_sigma(const ModelConfig& config, Rng& rng);

// The scales of a reverse process of `steps` >= 1 network calls, falling geometrically from sigma_max to sigma_min;
// for the paper's preset the nearest discrete ones. After the last call no noise is added. Throws
// std::invalid_argument if steps < 1 or `start` is not positive.
std::vector<double> sampling_schedule(const ModelConfig& config, int steps, double start);

}  // namespace dofusion
