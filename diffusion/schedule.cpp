#include "diffusion/schedule.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace dofusion {
namespace {

double geometric(double first, double last, int i, int count) {
  return count == 1 ? first : first * std::pow(last / first, static_cast<double>(i) / (count - 1));
}

}  // namespace

std::vector<double> discrete_schedule(const ModelConfig& config) {
  std::vector<double> sigmas(config.schedule_steps);
  for (int i = 0; i < config.schedule_steps; ++i)
    sigmas[i] = geometric(config.sigma_min, config.sigma_max, i, config.schedule_steps);
  return sigmas;
}

double draw_sigma(const ModelConfig& config, Rng& rng) {
  if (config.preset == Preset::kPaper) return discrete_schedule(config)[uniform_int(rng, 0, config.schedule_steps - 1)];
  return config.sigma_min * std::pow(config.sigma_max / config.sigma_min, uniform(rng));
}

std::vector<double> sampling_schedule(const ModelConfig& config, int steps, double start) {
  if (steps < 1)
    throw std::invalid_argument("the reverse process needs at least one step, not " + std::to_string(steps));
  if (!(start > 0)) throw std::invalid_argument("the starting noise scale must be positive");
  std::vector<double> sigmas(steps);
  for (int i = 0; i < steps; ++i) sigmas[i] = geometric(start, std::min(start, config.sigma_min), i, steps);
  if (config.preset == Preset::kPaper) {
    const std::vector<double> discrete = discrete_schedule(config);
    for (double& sigma : sigmas)
      sigma = *std::min_element(discrete.begin(), discrete.end(), [&](double a, double b) {
        return std::abs(std::log(a / sigma)) < std::abs(std::log(b / sigma));
      });
  }
  return sigmas;
}

}  // namespace dofusion
