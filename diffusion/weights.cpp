#include "diffusion/weights.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

using nlohmann::json;

constexpr const char* kModelFormat = "dofusion-placement-model";

std::string shape_text(const std::vector<std::int64_t>& shape) { return json(shape).dump(); }

}  // namespace

std::vector<NamedTensor> split_parameters(const std::vector<TensorInfo>& infos, const std::vector<float>& parameters,
                                          const std::string& prefix) {
  std::vector<NamedTensor> tensors;
  for (const TensorInfo& info : infos) {
    const auto first = parameters.begin() + static_cast<std::ptrdiff_t>(info.offset);
    tensors.push_back({prefix + info.name, info.shape, {first, first + static_cast<std::ptrdiff_t>(info.size)}});
  }
  return tensors;
}

std::vector<float> join_parameters(const std::vector<TensorInfo>& infos, const TensorFile& file,
                                   const std::string& source, const std::string& prefix) {
  std::map<std::string, const NamedTensor*> by_name;
  for (const NamedTensor& tensor : file.tensors) by_name[tensor.name] = &tensor;
  std::vector<float> parameters;
  for (const TensorInfo& info : infos) {
    const auto found = by_name.find(prefix + info.name);
    if (found == by_name.end())
      throw InputError(source + ": weights of another architecture: there is no tensor '" + prefix + info.name + "'");
    const NamedTensor& tensor = *found->second;
    if (tensor.shape != info.shape)
      throw InputError(source + ": weights of another architecture: tensor '" + tensor.name + "' has shape " +
                       shape_text(tensor.shape) + " where its configuration needs " + shape_text(info.shape));
    parameters.insert(parameters.end(), tensor.values.begin(), tensor.values.end());
  }
  return parameters;
}

ModelFile read_model(const std::string& path) {
  const TensorFile file = read_safetensors(path);
  const auto format = file.metadata.find("format");
  if (format == file.metadata.end() || format->second != kModelFormat)
    throw InputError(path + ": a safetensors file, but not a placement model (metadata format is not " +
                     std::string(kModelFormat) + ")");
  const auto config = file.metadata.find("config");
  if (config == file.metadata.end()) throw InputError(path + ": the metadata lacks the model's configuration");
  ModelFile model;
  model.config = config_from_json(config->second, path);
  const auto training = file.metadata.find("training");
  model.training = training == file.metadata.end() ? "{}" : training->second;
  std::vector<TensorInfo> infos;
  try {
    infos = make_network(model.config)->tensors();
  } catch (const std::runtime_error& e) {  // a network that this program was built without
    throw InputError(path + ": a " + to_string(model.config.preset) + " model: " + e.what());
  }
  if (file.tensors.size() != infos.size())
    throw InputError(path + ": weights of another architecture: " + std::to_string(file.tensors.size()) +
                     " tensors where the configuration needs " + std::to_string(infos.size()));
  model.parameters = join_parameters(infos, file, path);
  return model;
}

void write_model(const ModelFile& model, const std::string& path) {
  TensorFile file;
  file.metadata = {{"format", kModelFormat}, {"config", to_json(model.config)}, {"training", model.training}};
  file.tensors = split_parameters(make_network(model.config)->tensors(), model.parameters);
  write_safetensors(file, path);
}

}  // namespace dofusion
