#include "diffusion/optimizer.h"

#include <algorithm>
#include <cmath>
#include <thread>

namespace dofusion {

OptimizerState initial_state(std::vector<float> parameters) {
  OptimizerState state;
  state.average = parameters;
  state.first.assign(parameters.size(), 0.0f);
  state.second.assign(parameters.size(), 0.0f);
  state.parameters = std::move(parameters);
  return state;
}

double optimizer_step(const OptimizerOptions& options, const std::vector<TensorInfo>& tensors, double rate,
                      const std::vector<float>& gradient, OptimizerState& state, int threads) {
  double square = 0.0;
  for (const TensorInfo& tensor : tensors) {
    if (!tensor.trained) continue;
    float sums[16] = {};
    const float* g = gradient.data() + tensor.offset;
    std::size_t i = 0;
    for (; i + 16 <= tensor.size; i += 16)
      for (int j = 0; j < 16; ++j) sums[j] += g[i + j] * g[i + j];
    for (; i < tensor.size; ++i) sums[0] += g[i] * g[i];
    for (const float s : sums) square += s;
  }
  const double norm = std::sqrt(square);
  const auto scale = static_cast<float>(norm > options.clip_norm ? options.clip_norm / norm : 1.0);
  ++state.step;
  const double step = static_cast<double>(state.step);
  const auto b1 = static_cast<float>(options.beta1), b2 = static_cast<float>(options.beta2);
  const auto size = static_cast<float>(rate * options.learning_rate / (1.0 - std::pow(options.beta1, step)));
  const auto correction = static_cast<float>(1.0 / std::sqrt(1.0 - std::pow(options.beta2, step)));
  const auto keep = static_cast<float>(std::min(options.average, (1.0 + step) / (10.0 + step)));

  const auto update = [&](std::size_t begin, std::size_t end, float decay) {
    const float* g = gradient.data();
    float *p = state.parameters.data(), *m = state.first.data(), *v = state.second.data(), *a = state.average.data();
    for (std::size_t i = begin; i < end; ++i) {
      const float d = g[i] * scale;
      m[i] = b1 * m[i] + (1 - b1) * d;
      v[i] = b2 * v[i] + (1 - b2) * d * d;
      p[i] -= decay * p[i] + size * m[i] / (std::sqrt(v[i]) * correction + 1e-8f);
      a[i] = keep * a[i] + (1 - keep) * p[i];
    }
  };
  const auto work = [&](int thread) {
    for (const TensorInfo& tensor : tensors) {
      const std::size_t begin = tensor.offset + tensor.size * thread / threads;
      const std::size_t end = tensor.offset + tensor.size * (thread + 1) / threads;
      if (tensor.trained)
        update(begin, end,
               static_cast<float>(tensor.decays ? rate * options.learning_rate * options.weight_decay : 0.0));
    }
  };
  std::vector<std::thread> helpers;
  for (int t = 1; t < threads; ++t) helpers.emplace_back(work, t);
  work(0);
  for (std::thread& helper : helpers) helper.join();
  return norm;
}

double learning_rate_factor(std::int64_t step, std::int64_t warm_up, double progress) {
  const double rising = warm_up > 0 ? std::min(1.0, static_cast<double>(step + 1) / static_cast<double>(warm_up)) : 1.0;
  return rising * 0.5 * (1.0 + std::cos(M_PI * std::clamp(progress, 0.0, 1.0)));
}

}  // namespace dofusion
