// The paper's tables on held-out scenes, with the random baseline and the paper's own figures beside.
#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/assets.h"
#include "apps/evaluation.h"
#include "apps/program.h"
#ifdef DOFUSION_TORCH
#include "diffusion/torch_network.h"
#endif
#include "stability/files.h"

using namespace dofusion;

int main(int argc, char** argv) {
  CLI::App app{"Evaluates a placement model as the paper does: fresh scenes, one sample each, nothing filtered, "
               "settled in MuJoCo; the largest displacement over all objects.\n\nExample:\n  dofusion-evaluate --table "
               "unstructured --instances 500 --json unstructured.json",
               "dofusion-evaluate"};
  std::string table = "unstructured", model_path, shape, json_path;
  int context = 2, instances_count = 500;
  std::uint64_t seed = 20000;
  SamplerOptions sampler;
  sampler.threads = default_threads();
  app.add_option("--table", table, "single (I), stack-one (II), stack-two (III) or unstructured (IV)")
      ->check(CLI::IsMember({"single", "stack-one", "stack-two", "unstructured"}))
      ->capture_default_str();
  app.add_option("--model", model_path, "a model file; default: the shipped one");
  app.add_option("--shape", shape, "only scenes whose query is this block");
  app.add_option("--context", context, "blocks besides the query in unstructured scenes")
      ->check(CLI::Range(1, 5))
      ->capture_default_str();
  app.add_option("--instances", instances_count, "scenes in all, the seven blocks in turn as the query")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  app.add_option("--steps", sampler.steps, "reverse steps of the sampler")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--points", sampler.points, "points of a scene's cloud; 0: as in training")->capture_default_str();
  app.add_option("--seed", seed, "of scenes and samples")->check(CLI::NonNegativeNumber)->capture_default_str();
  app.add_option("--threads", sampler.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", json_path, "write the rows to this file");

  return run_program(app, argc, argv, [&] {
    if (!json_path.empty()) check_writable(json_path);
#ifdef DOFUSION_TORCH
    enable_torch_networks(sampler.threads);  // for models of the paper's preset
#endif
    const PlacementModel model = PlacementModel::load(model_path.empty() ? default_model_path() : model_path);
    InstanceOptions options;
    options.seed = seed;
    options.count = instances_count;
    options.threads = sampler.threads;
    if (!shape.empty()) options.shape = shape;
    options.task = table == "single" ? Task::kSingle : table == "unstructured" ? Task::kUnstructured : Task::kStack;
    options.context = table == "single" ? 0 : table == "stack-one" ? 1 : table == "stack-two" ? 2 : context;

    const std::vector<Instance> instances = make_instances(options);
    const auto settle = [&](const std::vector<Pose>& poses) { return settle_placements(instances, poses, sampler.threads); };
    const std::vector<Outcome> ours = settle(sample_placements(instances, model, seed, sampler));
    const std::vector<Outcome> random = settle(random_placements(instances, seed));
    const nlohmann::json rows = table_rows(table, instances, ours, random, seed);
    std::printf("%s", format_rows(rows).c_str());
    if (!json_path.empty()) {
      const nlohmann::json result = {{"format", "dofusion-evaluation"}, {"version", 1},
                                     {"table", table},                  {"context", options.context},
                                     {"steps", sampler.steps},          {"seed", seed},
                                     {"instances", instances_count},    {"rows", rows}};
      write_file(json_path, result.dump(2) + "\n");
    }
  });
}
