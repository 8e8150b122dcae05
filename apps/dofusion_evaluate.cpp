// The paper's tables on held-out scenes, with the random baseline and the paper's own figures beside.
#include <cstdio>

#include <nlohmann/json.hpp>

#include "apps/assets.h"
#include "apps/evaluate_job.h"
#include "apps/program.h"
#ifdef DOFUSION_TORCH
#include "diffusion/torch_network.h"
#endif
#include "stability/files.h"

using namespace dofusion;

int main(int argc, char** argv) {
  CLI::App app{
      "Evaluates placement models as the paper does: fresh scenes, one sample each, nothing filtered, settled in "
      "MuJoCo; "
      "the largest displacement over all objects.\n\nExamples:\n"
      "  dofusion-evaluate --table unstructured --instances 500 --json unstructured.json\n"
      "  dofusion-evaluate --table stack-one --model all.safetensors without_hat.safetensors --shape hat\n"
      "  dofusion-evaluate --table ablation --model full.safetensors no_sdf.safetensors no_pose.safetensors\n"
      "  dofusion-evaluate --table unstructured --shapes general --context 4\n\n"
      "A model file knows which shape it has never seen, and what it does without.",
      "dofusion-evaluate"};
  EvaluateSettings settings;
  settings.sampler.threads = default_threads();
  std::string json_path;
  app.add_option("--table", settings.table,
                 "single (I), stack-one (II), stack-two (III), unstructured (IV) or ablation (V)")
      ->check(CLI::IsMember({"single", "stack-one", "stack-two", "unstructured", "ablation"}))
      ->capture_default_str();
  app.add_option("--model", settings.models, "model files; default: the shipped one");
  app.add_option("--shape", settings.shape, "only scenes whose query is this block");
  app.add_option("--shapes", settings.shapes, "of the scenes: blocks, or general (without figures of the paper)")
      ->check(CLI::IsMember({"blocks", "general"}))
      ->capture_default_str();
  app.add_option("--context", settings.context, "objects besides the query in unstructured scenes")
      ->check(CLI::Range(1, 5))
      ->capture_default_str();
  app.add_option("--instances", settings.instances, "scenes in all, the seven blocks in turn as the query")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  app.add_option("--best-of", settings.best_of, "also: in how many scenes one of so many samples is stable")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--steps", settings.sampler.steps, "reverse steps of the sampler")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  app.add_option("--points", settings.sampler.points, "points of a scene's cloud; 0: as in training")
      ->capture_default_str();
  app.add_option("--seed", settings.seed, "of scenes and samples")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--threads", settings.sampler.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", json_path, "write the rows to this file");

  return run_program(app, argc, argv, [&] {
    if (!json_path.empty()) check_writable(json_path);
#ifdef DOFUSION_TORCH
    enable_torch_networks(settings.sampler.threads);  // for models of the paper's preset
#endif
    if (settings.models.empty()) settings.models = {default_model_path()};
    const nlohmann::json result = evaluate(settings);
    summary(format_evaluation(result));
    if (!json_path.empty()) write_file(json_path, result.dump(2) + "\n");
  });
}
