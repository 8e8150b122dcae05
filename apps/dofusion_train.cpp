// Trains the placement model on datasets of stable scenes.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#ifdef DOFUSION_TORCH
#include "diffusion/torch_network.h"
#endif
#include "diffusion/trainer.h"
#include "stability/files.h"

using namespace dofusion;

namespace {

void print(const TrainReport& r) {
  const auto minutes = static_cast<int>(r.seconds_left / 60.0);
  std::fprintf(
      stderr, "step %lld  %.2f M samples  loss %.4f (low %.4f, middle %.4f, high %.4f)  %.0f samples/s  %d:%02d left\n",
      static_cast<long long>(r.step), static_cast<double>(r.samples) * 1e-6, r.loss, r.loss_by_noise[0],
      r.loss_by_noise[1], r.loss_by_noise[2], r.samples_per_second, minutes,
      static_cast<int>(r.seconds_left - 60.0 * minutes));
}

bool has_shape(const std::vector<SceneDataset>& datasets, const std::string& name) {
  return std::any_of(datasets.begin(), datasets.end(), [&](const SceneDataset& dataset) {
    return std::any_of(dataset.shapes.begin(), dataset.shapes.end(),
                       [&](const ObjectPtr& shape) { return shape->name == name; });
  });
}

std::string name_of(const std::string& path) { return std::filesystem::path(path).filename().string(); }

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Trains the placement model on datasets of stable scenes.\n\nExample:\n  dofusion-train --data one.h5 "
      "two.h5 --minutes 60 --out model.safetensors\n\nFILE.checkpoint and FILE.csv appear beside the model; "
      "after a kill the same command with --resume goes on.",
      "dofusion-train"};
  std::string preset = "default", config_path, holdout, json_path;
  std::vector<std::string> data;
  TrainOptions options;
  options.threads = default_threads();
  app.add_option("--preset", preset, "default, or paper: the published method to the letter")->capture_default_str();
  app.add_option("--config", config_path, "JSON file of settings that replace the preset's");
  app.add_option("--data", data, "datasets of dofusion-generate; their scenes for training are used")->required();
  app.add_option("--holdout-shape", holdout, "leave out every scene with this shape");
  app.add_option("--out", options.out, "the model, safetensors")->required();
  app.add_flag("--resume", options.resume, "go on from FILE.checkpoint");
  app.add_option("--minutes", options.minutes, "planned time; the learning rate falls to 0 by then")
      ->check(CLI::Range(0.01, 1e6));
  app.add_option("--steps", options.steps, "planned steps")->check(CLI::Range(1, 1'000'000'000));
  app.add_option("--batch", options.batch, "scenes in a step")->check(CLI::Range(1, 65536))->capture_default_str();
  app.add_option("--learning-rate", options.optimizer.learning_rate)
      ->check(CLI::Range(1e-8, 1.0))
      ->capture_default_str();
  app.add_option("--warm-up", options.warm_up, "steps of rising learning rate")
      ->check(CLI::Range(0, 1'000'000))
      ->capture_default_str();
  app.add_option("--seed", options.seed)->check(CLI::NonNegativeNumber)->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--report-seconds", options.report_seconds, "between progress lines")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--json", json_path, "write the result here");

  return run_program(app, argc, argv, [&] {
    if (!options.resume && std::filesystem::exists(options.out)) {
      throw InputError(options.out + ": exists already; --resume goes on with its training, another --out begins anew");
    }
    if (options.resume && !std::filesystem::exists(options.out + ".checkpoint")) {
      throw InputError(options.out + ".checkpoint: no such file; there is no training to go on with");
    }
    if (!json_path.empty()) check_writable(json_path);
    ModelConfig config = make_config(preset_from_string(preset));
    if (!config_path.empty()) config = config_from_json(read_file(config_path), config_path, config);
#ifdef DOFUSION_TORCH
    if (config.preset == Preset::kPaper) enable_torch_networks(options.threads);
#endif
    DatasetFilter filter;
    filter.split = Split::kTrain;
    filter.without_shape = holdout;
    std::vector<SceneDataset> datasets;
    nlohmann::json record{{"data", nlohmann::json::array()}, {"holdout_shape", holdout}};
    for (const std::string& path : data) {
      datasets.push_back(read_dataset(path, filter));
      record["data"].push_back(
          {{"file", name_of(path)}, {"scenes", datasets.back().scenes.size()}, {"settings", datasets.back().settings}});
    }
    if (!holdout.empty() && !has_shape(datasets, holdout)) {
      throw InputError("--holdout-shape: no shape of the data is called '" + holdout + "'");
    }
    const TrainingSet set(std::move(datasets), config);
    std::fprintf(stderr, "%zu scenes, preset %s, %d threads\n", set.scenes(), to_string(config.preset).c_str(),
                 options.threads);
    const auto report = [](const TrainReport& r) {
      print(r);
      return true;
    };
    const TrainResult result =
        train(set, config, options, record.dump(), report, [](const TrainReport&) { return !interrupted(); });
    if (!json_path.empty()) {
      const nlohmann::json j{{"finished", result.finished},
                             {"steps", result.last.step},
                             {"samples", result.last.samples},
                             {"seconds", result.last.seconds},
                             {"model", options.out}};
      write_file(json_path, j.dump(2) + "\n");
    }
    if (!result.finished) throw Interrupted("interrupted; go on with --resume");
    std::printf("%s: %lld steps, %.2f M samples in %.1f minutes\n", options.out.c_str(),
                static_cast<long long>(result.last.step), static_cast<double>(result.last.samples) * 1e-6,
                result.last.seconds / 60.0);
  });
}
