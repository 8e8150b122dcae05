#include "diffusion/checkpoint.h"

#include <nlohmann/json.hpp>

#include "diffusion/weights.h"
#include "stability/files.h"

namespace dofusion {
namespace {

constexpr const char* kFormat = "dofusion-checkpoint";

}  // namespace

void write_checkpoint(const Checkpoint& c, const std::vector<TensorInfo>& tensors, const std::string& path) {
  TensorFile file;
  file.metadata = {
      {"format", kFormat},
      {"config", to_json(c.config)},
      {"run",
       nlohmann::json{{"step", c.state.step}, {"seed", c.seed}, {"batch", c.batch}, {"seconds", c.seconds}}.dump()}};
  const std::pair<const char*, const std::vector<float>*> parts[] = {{"parameters/", &c.state.parameters},
                                                                     {"average/", &c.state.average},
                                                                     {"first_moment/", &c.state.first},
                                                                     {"second_moment/", &c.state.second}};
  for (const auto& [prefix, values] : parts)
    for (NamedTensor& tensor : split_parameters(tensors, *values, prefix)) file.tensors.push_back(std::move(tensor));
  write_safetensors(file, path);
}

Checkpoint read_checkpoint(const std::vector<TensorInfo>& tensors, const std::string& path) {
  const TensorFile file = read_safetensors(path);
  const auto metadata = [&](const char* key) {
    const auto found = file.metadata.find(key);
    if (found == file.metadata.end()) throw InputError(path + ": not a checkpoint: the metadata lacks '" + key + "'");
    return found->second;
  };
  if (metadata("format") != kFormat) throw InputError(path + ": not a training checkpoint");
  Checkpoint c;
  c.config = config_from_json(metadata("config"), path);
  try {
    const nlohmann::json run = nlohmann::json::parse(metadata("run"));
    c.state.step = run.at("step").get<std::int64_t>();
    c.seed = run.at("seed").get<std::uint64_t>();
    c.batch = run.at("batch").get<int>();
    c.seconds = run.at("seconds").get<double>();
  } catch (const nlohmann::json::exception&) {
    throw InputError(path + ": damaged: its 'run' record is not readable");
  }
  if (c.state.step < 0 || c.batch < 1 || !(c.seconds >= 0))
    throw InputError(path + ": damaged: its 'run' record is nonsense");
  c.state.parameters = join_parameters(tensors, file, path, "parameters/");
  c.state.average = join_parameters(tensors, file, path, "average/");
  c.state.first = join_parameters(tensors, file, path, "first_moment/");
  c.state.second = join_parameters(tensors, file, path, "second_moment/");
  return c;
}

}  // namespace dofusion
