#include "apps/train_job.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "apps/training_plot.h"
#ifdef DOFUSION_TORCH
#include "diffusion/torch_network.h"
#endif
#ifdef DOFUSION_VALIDATION
#include "apps/evaluation.h"
#endif
#include "diffusion/weights.h"
#include "stability/files.h"

namespace dofusion {
namespace {

using Json = nlohmann::json;

void print(const TrainReport& r) {
  const auto minutes = static_cast<int>(r.seconds_left / 60.0);
  char line[256];
  std::snprintf(line, sizeof line,
                "step %lld  %.2f M samples  loss %.4f (low %.4f, middle %.4f, high %.4f)  %.0f samples/s  %d:%02d left",
                static_cast<long long>(r.step), static_cast<double>(r.samples) * 1e-6, r.loss, r.loss_by_noise[0],
                r.loss_by_noise[1], r.loss_by_noise[2], r.samples_per_second, minutes,
                static_cast<int>(r.seconds_left - 60.0 * minutes));
  char stable[32] = "";
  if (std::isfinite(r.validation)) std::snprintf(stable, sizeof stable, "  %.0f %% stable", 100.0 * r.validation);
  note(std::string(line) + stable);
}

void check_files(const TrainOptions& options) {
  if (!options.resume && std::filesystem::exists(options.out))
    throw InputError(options.out + ": exists already; --resume goes on with its training, another --out begins anew");
  if (options.resume && !std::filesystem::exists(options.out + ".checkpoint"))
    throw InputError(options.out + ".checkpoint: no such file; there is no training to go on with");
}

// The configuration, and into `parameters` the weights to begin with, if a model is given.
ModelConfig read_config(const TrainSettings& settings, std::vector<float>& parameters) {
  ModelConfig config;
  if (settings.from.empty()) {
    config = make_config(preset_from_string(settings.preset));
  } else {
    ModelFile model = read_model(settings.from);
    config = model.config;
    parameters = std::move(model.parameters);
  }
  if (settings.config_path.empty()) return config;
  config = config_from_json(read_file(settings.config_path), settings.config_path, config);
  if (!parameters.empty() && parameters.size() != static_cast<std::size_t>(make_network(config)->parameter_count()))
    throw InputError(settings.config_path +
                     ": changes the size of the network, so it cannot begin with the weights of " + settings.from);
  return config;
}

std::vector<SceneDataset> read_scenes(const TrainSettings& settings, Split split) {
  DatasetFilter filter;
  filter.split = split;
  filter.without_shape = settings.held_out_shape;
  for (const std::string& task : settings.tasks) filter.tasks.push_back(task_from_string(task));
  std::vector<SceneDataset> datasets;
  for (const std::string& path : settings.data) {
    datasets.push_back(read_dataset(path, filter));
    detail(path + ": " + std::to_string(datasets.back().scenes.size()) + " scenes for " + to_string(split));
  }
  return datasets;
}

void check_held_out(const std::string& name, const std::vector<SceneDataset>& datasets) {
  if (name.empty()) return;
  for (const SceneDataset& dataset : datasets)
    for (const ObjectPtr& shape : dataset.shapes)
      if (shape->name == name) return;
  throw InputError("--holdout-shape: no shape of the data is called '" + name + "'");
}

// What the model file says of its data.
Json record_of(const TrainSettings& settings, const std::vector<SceneDataset>& datasets) {
  Json record{{"data", Json::array()}, {"holdout_shape", settings.held_out_shape}, {"tasks", settings.tasks}};
  if (!settings.from.empty()) record["from"] = std::filesystem::path(settings.from).filename().string();
  for (std::size_t i = 0; i < datasets.size(); ++i)
    record["data"].push_back({{"file", std::filesystem::path(settings.data[i]).filename().string()},
                              {"scenes", datasets[i].scenes.size()},
                              {"settings", datasets[i].settings}});
  return record;
}

#ifdef DOFUSION_VALIDATION
// The share of validation scenes in which a pose from the model, one raw sample, is stable.
std::function<double(const ModelConfig&, const std::vector<float>&)> make_validation(const TrainSettings& settings) {
  if (settings.validation == 0 || settings.rank > 0) return {};
  std::vector<Instance> instances =
      instances_of(read_scenes(settings, Split::kValidation), settings.validation, settings.options.seed);
  if (instances.empty()) {
    note("no validation: the data has no scenes for it");
    return {};
  }
  return [instances = std::move(instances), threads = settings.options.threads](const ModelConfig& config,
                                                                                const std::vector<float>& parameters) {
    SamplerOptions sampler;
    sampler.threads = threads;
    const PlacementModel model(config, parameters);
    const std::vector<Outcome> outcomes =
        settle_placements(instances, sample_placements(instances, model, 1, sampler), threads);
    const auto stable = std::count_if(outcomes.begin(), outcomes.end(), [](const Outcome& o) { return o.stable; });
    return static_cast<double>(stable) / static_cast<double>(outcomes.size());
  };
}
#endif

std::unique_ptr<Peers> meet(const TrainSettings& settings) {
  if (settings.processes == 1) return nullptr;
#ifdef DOFUSION_TORCH
  return meet_peers(settings.rank, settings.processes, settings.rendezvous);
#else
  throw InputError("--world-size: this program was built without libtorch (DOFUSION_TORCH), which joins processes");
#endif
}

}  // namespace

Json train_model(const TrainSettings& settings) {
  const bool first = settings.rank == 0;
  if (first) check_files(settings.options);
  TrainOptions options = settings.options;
  const ModelConfig config = read_config(settings, options.parameters);
#ifdef DOFUSION_TORCH
  if (config.preset == Preset::kPaper) enable_torch_networks(settings.options.threads);
#endif
  std::vector<SceneDataset> datasets = read_scenes(settings, Split::kTrain);
  check_held_out(settings.held_out_shape, datasets);
  const Json record = record_of(settings, datasets);
  const TrainingSet set(std::move(datasets), config);

  const std::string log = settings.options.out + ".csv", plot = settings.options.out + ".svg";
  TrainCallbacks callbacks;
  callbacks.keep_going = [](const TrainReport&) { return !interrupted(); };
  callbacks.report = [&](const TrainReport& r) {
    print(r);
    write_file(plot, training_plot(read_file(log)));
  };
#ifdef DOFUSION_VALIDATION
  callbacks.validate = make_validation(settings);
#endif
  const std::unique_ptr<Peers> peers = meet(settings);
  if (first)
    note(std::to_string(set.scenes()) + " scenes, preset " + to_string(config.preset) + ", " +
         std::to_string(settings.options.threads) + " threads" +
         (peers ? ", " + std::to_string(peers->count()) + " processes" : ""));
  const TrainResult result = train(set, config, options, record.dump(), callbacks, peers.get());
  if (!result.finished) throw Interrupted("interrupted; go on with --resume");
  return {{"finished", result.finished},
          {"steps", result.last.step},
          {"samples", result.last.samples},
          {"seconds", result.last.seconds},
          {"loss", result.last.loss},
          {"validation_stable", std::isfinite(result.last.validation) ? Json(result.last.validation) : Json()},
          {"model", settings.options.out}};
}

}  // namespace dofusion
