// Model files: a network's parameters as safetensors.
#pragma once

#include <string>
#include <vector>

#include "diffusion/config.h"
#include "diffusion/network.h"
#include "diffusion/safetensors.h"

namespace dofusion {

// A model file: the network's tensors, with "config" (JSON) and "training" (JSON, a record for people) as metadata.
struct ModelFile {
  ModelConfig config;
  std::string training;           // JSON text
  std::vector<float> parameters;  // flat, in the order of the network's tensors
};

// Throws InputError naming the file and what differs from what its configuration needs.
ModelFile read_model(const std::string& path);

void write_model(const ModelFile& model, const std::string& path);

// The flat array as named tensors, each name with `prefix` before it, and back.
std::vector<NamedTensor> split_parameters(const std::vector<TensorInfo>& infos, const std::vector<float>& parameters,
                                          const std::string& prefix = "");
std::vector<float> join_parameters(const std::vector<TensorInfo>& infos, const TensorFile& file,
                                   const std::string& source, const std::string& prefix = "");

}  // namespace dofusion
