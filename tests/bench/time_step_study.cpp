// Whether verdicts on generated poses hang on the time step: poses of the placement model, one raw sample a scene,
// are settled at the usual time step and at half of it.
//
//   time_step_study [--model FILE] [--instances 1000] [--seed 50000] [--threads T]
#include <cmath>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "apps/assets.h"
#include "apps/evaluation.h"
#include "apps/program.h"

namespace {

using namespace dofusion;

struct Row {
  const char* name;
  Task task;
  int context;
};

constexpr Row kRows[] = {{"one block", Task::kSingle, 0},
                         {"with one other", Task::kUnstructured, 1},
                         {"with two others", Task::kUnstructured, 2},
                         {"on a stack of two", Task::kStack, 2}};

void report(const Row& row, const InstanceOptions& base, const PlacementModel& model, const SamplerOptions& sampler) {
  InstanceOptions options = base;
  options.task = row.task;
  options.context = row.context;
  const std::vector<Instance> instances = make_instances(options);
  const std::vector<Pose> poses = sample_placements(instances, model, options.seed, sampler);
  PhysicsOptions half_step;
  half_step.timestep /= 2.0;
  const std::vector<Outcome> usual = settle_placements(instances, poses, options.threads);
  const std::vector<Outcome> halved = settle_placements(instances, poses, options.threads, half_step);
  int stable = 0, flipped = 0;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    stable += usual[i].stable ? 1 : 0;
    flipped += usual[i].stable != halved[i].stable ? 1 : 0;
  }
  // Wilson's 95 % interval of the share.
  const double n = static_cast<double>(instances.size()), p = flipped / n, z2 = 1.96 * 1.96;
  const double centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
  const double half_width = 1.96 * std::sqrt(p * (1.0 - p) / n + z2 / (4.0 * n * n)) / (1.0 + z2 / n);
  std::printf("%-18s half the time step changes %.2f %% of %zu verdicts (95 %%: %.2f to %.2f); %.1f %% are stable\n",
              row.name, 100.0 * p, instances.size(), 100.0 * (centre - half_width), 100.0 * (centre + half_width),
              100.0 * stable / n);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  std::string model_path;
  InstanceOptions options;
  options.count = 1000;
  options.seed = 50000;
  options.threads = default_threads();
  SamplerOptions sampler;
  CLI::App app{"Counts the verdicts on generated poses that half the time step changes.", "time_step_study"};
  app.add_option("--model", model_path, "a model file; default: the shipped one");
  app.add_option("--instances", options.count, "scenes of each kind")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of scenes and samples")->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  return run_program(app, argc, argv, [&] {
    sampler.threads = options.threads;
    const PlacementModel model = PlacementModel::load(model_path.empty() ? default_model_path() : model_path);
    for (const Row& row : kRows) report(row, options, model, sampler);
  });
}
