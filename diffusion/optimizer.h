// AdamW with gradient clipping and averaged weights, on flat arrays.
#pragma once

#include <cstdint>
#include <vector>

#include "diffusion/network.h"

namespace dofusion {

struct OptimizerOptions {
  double learning_rate = 1e-3;  // at its peak
  double weight_decay = 0.01;   // of matrices only
  double beta1 = 0.9, beta2 = 0.99;
  double clip_norm = 1.0;  // the gradient's length is cut to this
  double average = 0.999;  // decay of the averaged weights
};

struct OptimizerState {
  std::int64_t step = 0;
  std::vector<float> parameters, average;  // flat, as the network's
  std::vector<float> first, second;        // moments
};

OptimizerState initial_state(std::vector<float> parameters);

// One step along `gradient` at `rate` times the peak learning rate, on `threads` threads (the result does not depend
// on their number). Returns the gradient's length before clipping.
double optimizer_step(const OptimizerOptions& options, const std::vector<TensorInfo>& tensors, double rate,
                      const std::vector<float>& gradient, OptimizerState& state, int threads = 1);

// Share of the peak learning rate at `progress` in [0, 1] of the run: cosine to 0, after `warm_up` steps that rise
// linearly.
double learning_rate_factor(std::int64_t step, std::int64_t warm_up, double progress);

}  // namespace dofusion
