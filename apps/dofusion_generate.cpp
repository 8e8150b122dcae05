// Stable scenes by dropping or stacking objects, to an HDF5 dataset.
#include <cstdio>

#include "apps/generate_job.h"
#include "apps/program.h"
#include "apps/ranks.h"
#include "stability/files.h"
#include "stability/generation_plan.h"

using namespace dofusion;

namespace {

struct Arguments {
  std::string task = "unstructured", shapes = "blocks", recipe, out, json;
  int objects = 2, threads = default_rank_threads();
  std::int64_t count = 1000;
  std::uint64_t seed = 0;
  double scale = 1.0;
};

GenerationPlan plan_of(const Arguments& arguments) {
  if (arguments.recipe == "paper") return finished_plan(paper_plan(), arguments.seed, arguments.scale);
  if (!arguments.recipe.empty()) {
    return finished_plan(plan_from_json(read_file(arguments.recipe), arguments.recipe), arguments.seed,
                         arguments.scale);
  }
  PlanPart part;
  part.options.task = task_from_string(arguments.task);
  part.options.objects = part.options.task == Task::kSingle ? 1 : arguments.objects;
  part.options.shapes = shape_family_from_string(arguments.shapes);
  part.count = arguments.count;
  GenerationPlan plan;
  plan.parts.push_back(part);
  return finished_plan(plan, arguments.seed);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Generates stable scenes by dropping objects one by one, or by stacking them, and simulating until "
      "everything rests. After a kill the same command goes on where it was.\n\nExamples:\n"
      "  dofusion-generate --task unstructured --objects 2 --count 10000 --out two.h5\n"
      "  dofusion-generate --recipe paper --out paper.h5\n"
      "  mpirun --hostfile hosts --map-by ppr:1:node --bind-to none dofusion-generate --recipe paper --out paper.h5",
      "dofusion-generate"};
  Arguments arguments;
  auto* recipe = app.add_option("--recipe", arguments.recipe,
                                "several kinds of scenes in one dataset: paper (800,000 scenes), or a JSON file of "
                                "{\"parts\": [{\"task\", \"objects\", \"shapes\", \"count\"}, ...]}");
  app.add_option("--scale", arguments.scale, "multiplies the recipe's counts")
      ->check(CLI::Range(1e-6, 1e3))
      ->needs(recipe);
  app.add_option("--task", arguments.task, "or one kind: single, unstructured or stack")
      ->capture_default_str()
      ->excludes(recipe);
  app.add_option("--objects", arguments.objects, "objects in a scene, 1 to 6 (1 for single)")
      ->capture_default_str()
      ->excludes(recipe);
  app.add_option("--shapes", arguments.shapes, "blocks (the seven) or general (boxes of random proportions and blocks)")
      ->capture_default_str()
      ->excludes(recipe);
  app.add_option("--count", arguments.count, "scenes")
      ->check(CLI::Range(1, 100'000'000))
      ->capture_default_str()
      ->excludes(recipe);
  app.add_option("--seed", arguments.seed, "the same seed gives the same file on any number of threads and machines")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "of this process")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", arguments.json, "write what was done to this file");
  app.add_option("--out", arguments.out, "the dataset, HDF5; FILE.partial keeps the scenes until it is whole")
      ->required();

  const auto body = [&] {
    Ranks ranks;
    if (!ranks.first()) {
      help_to_generate(
          ranks, [&] { return plan_of(arguments); }, arguments.threads);
      return;
    }
    if (!arguments.json.empty()) check_writable(arguments.json);
    const GenerateResult result = generate_dataset(ranks, plan_of(arguments), arguments.out, arguments.threads);
    if (!arguments.json.empty()) write_file(arguments.json, result.summary.dump(2) + "\n");
    summary(result.line + "\nnext: dofusion-train --data " + arguments.out + " … or dofusion-scan --data " +
            arguments.out + " …\n");
  };
  return run_program(app, argc, argv, body, rank_from_environment() == 0);
}
