// Trains the placement model on datasets of stable scenes.
#include <cstdio>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "apps/train_job.h"
#include "stability/files.h"

using namespace dofusion;

int main(int argc, char** argv) {
  CLI::App app{
      "Trains the placement model on datasets of stable scenes.\n\nExamples:\n"
      "  dofusion-train --data one.h5 two.h5 --minutes 60 --out model.safetensors\n"
      "  dofusion-train --data one.h5 --minutes 60 --holdout-shape hat --out without_hat.safetensors\n"
      "  dofusion-train --data one.h5 --task stack --minutes 20 --out stacks.safetensors\n"
      "  dofusion-train --data mine.h5 --from model.safetensors --minutes 20 --out mine.safetensors\n"
      "  dofusion-train --data one.h5 --steps 20000 --rank 1 --world-size 2 --rendezvous first-host:29500 …\n\n"
      "FILE.checkpoint, FILE.csv and FILE.svg appear beside the model; after a kill the same command with --resume "
      "goes "
      "on.",
      "dofusion-train"};
  TrainSettings settings;
  TrainOptions& options = settings.options;
  options.threads = default_threads();
  options.validate_minutes = 10.0;
  std::string json_path;
  CLI::Option* preset =
      app.add_option("--preset", settings.preset, "default, or paper: the published method to the letter")
          ->capture_default_str();
  app.add_option("--config", settings.config_path, "JSON file of settings that replace the preset's, or the model's");
  app.add_option("--from", settings.from, "a model to begin with: its configuration and its weights")->excludes(preset);
  app.add_option("--data", settings.data, "datasets of dofusion-generate; their scenes for training are used")
      ->required();
  app.add_option("--holdout-shape", settings.held_out_shape, "leave out every scene with this shape");
  app.add_option("--task", settings.tasks, "use the scenes of these tasks alone")
      ->check(CLI::IsMember({"single", "stack", "unstructured"}));
  app.add_option("--out", options.out, "the model, safetensors")->required();
  app.add_flag("--resume", options.resume, "go on from FILE.checkpoint");
  app.add_option("--minutes", options.minutes, "planned time; the learning rate falls to 0 by then")
      ->check(CLI::Range(0.01, 1e6));
  app.add_option("--steps", options.steps, "planned steps")->check(CLI::Range(1, 1'000'000'000));
  app.add_option("--batch", options.batch, "scenes in a step, of each process")
      ->check(CLI::Range(1, 65536))
      ->capture_default_str();
  app.add_option("--learning-rate", options.optimizer.learning_rate)
      ->check(CLI::Range(1e-8, 1.0))
      ->capture_default_str();
  app.add_option("--warm-up", options.warm_up, "steps of rising learning rate")
      ->check(CLI::Range(0, 1'000'000))
      ->capture_default_str();
  app.add_option("--validation", settings.validation,
                 "scenes of the data's validation split to sample and settle; 0: none")
      ->check(CLI::Range(0, 100'000))
      ->capture_default_str();
  app.add_option("--validate-minutes", options.validate_minutes, "between validations; 0: at the end alone")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--world-size", settings.processes, "processes that train together")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  app.add_option("--rank", settings.rank, "which of them this is, from 0; the first one writes the files")
      ->check(CLI::Range(0, 4095))
      ->capture_default_str();
  app.add_option("--rendezvous", settings.rendezvous, "HOST:PORT of rank 0, where the processes meet");
  app.add_option("--seed", options.seed)->check(CLI::NonNegativeNumber)->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--report-seconds", options.report_seconds, "between progress lines")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--json", json_path, "write the result here");

  return run_program(app, argc, argv, [&] {
    if (!json_path.empty()) check_writable(json_path);
    const nlohmann::json result = train_model(settings);
    if (settings.rank > 0) return;
    if (!json_path.empty()) write_file(json_path, result.dump(2) + "\n");
    char line[96];
    std::snprintf(line, sizeof line, ": %lld steps, %.2f M samples in %.1f minutes\n", result["steps"].get<long long>(),
                  1e-6 * result["samples"].get<double>(), result["seconds"].get<double>() / 60.0);
    summary(options.out + line + "next: dofusion-evaluate --model " + options.out + "\n");
  });
}
