// A training run's whole state in one safetensors file.
#pragma once

#include <string>

#include "diffusion/config.h"
#include "diffusion/optimizer.h"

namespace dofusion {

struct Checkpoint {
  ModelConfig config;
  OptimizerState state;
  std::uint64_t seed = 0;
  int batch = 0;
  double seconds = 0.0;  // trained so far
};

void write_checkpoint(const Checkpoint& checkpoint, const std::vector<TensorInfo>& tensors, const std::string& path);

// Throws InputError naming the file if it is damaged or its network differs from `tensors`.
Checkpoint read_checkpoint(const std::vector<TensorInfo>& tensors, const std::string& path);

}  // namespace dofusion
