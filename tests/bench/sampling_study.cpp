// Where raw samples of a placement model fail, and what the sampler's settings are worth, on unstructured scenes that
// no training has seen.
//
//   sampling_study starts   [--model FILE] [--context 2] [--instances 200] [--seed 987654]
//   sampling_study guidance …
//   sampling_study samplers …
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "apps/assets.h"
#include "apps/evaluation.h"
#include "apps/program.h"
#include "apps/stopwatch.h"

namespace {

using namespace dofusion;

struct Study {
  PlacementModel model;
  std::vector<Instance> instances;
  std::uint64_t seed;
  int threads;

  std::vector<PlacementProblem> problems() const { return placement_problems(instances, seed); }
  std::vector<Outcome> outcomes(const std::vector<PlacementProblem>& problems, SamplerOptions options) const {
    options.threads = threads;
    return settle_placements(instances, model.sample(problems, options), threads);
  }
};

template <typename Keep>
std::string stable_share(const Study& study, const std::vector<Outcome>& outcomes, Keep&& keep) {
  std::vector<double> stable;
  for (std::size_t i = 0; i < outcomes.size(); ++i)
    if (keep(study.instances[i])) stable.push_back(outcomes[i].stable ? 100.0 : 0.0);
  if (stable.empty()) return "     –     ";
  Rng rng = make_rng(study.seed, 1);
  const Interval interval = bootstrap_mean(stable, rng);
  double sum = 0.0;
  for (const double s : stable) sum += s;
  char text[64];
  std::snprintf(text, sizeof text, "%3.0f [%3.0f, %3.0f]", sum / static_cast<double>(stable.size()), interval.low,
                interval.high);
  return text;
}

bool any(const Instance&) { return true; }

// The reverse process begun at the true pose with noise: up to where the model is exact, and where it must choose.
void starts(const Study& study) {
  const ModelConfig& config = study.model.config();
  std::printf("%% stable from the true pose with noise sigma (normalised lengths, radians)\n");
  std::printf("%6s %6s  %-15s %-15s %-15s\n", "sigma", "steps", "all", "context stands", "context falls");
  const double decades = std::log(config.sigma_max / config.sigma_min);
  for (const double sigma : {0.01, 0.03, 0.1, 0.2, 0.4, 0.8, 1.5, config.sigma_max}) {
    std::vector<PlacementProblem> problems = study.problems();
    if (sigma < config.sigma_max)
      for (std::size_t i = 0; i < problems.size(); ++i) problems[i].start = study.instances[i].T_world_query;
    SamplerOptions options;
    options.start_sigma = sigma;
    options.steps = std::max(2, static_cast<int>(50.0 * std::log(sigma / config.sigma_min) / decades));
    const std::vector<Outcome> outcomes = study.outcomes(problems, options);
    std::printf("%6.3g %6d  %-15s %-15s %-15s\n", sigma, options.steps, stable_share(study, outcomes, any).c_str(),
                stable_share(study, outcomes, [](const Instance& i) { return i.context_stands; }).c_str(),
                stable_share(study, outcomes, [](const Instance& i) { return !i.context_stands; }).c_str());
    std::fflush(stdout);
  }
}

void print_quality(const Study& study, const std::vector<Outcome>& outcomes) {
  std::vector<double> translation, rotation, penetration;
  for (const Outcome& outcome : outcomes) {
    translation.push_back(outcome.displacement.translation_pct);
    rotation.push_back(outcome.displacement.rotation_deg);
    penetration.push_back(1e3 * outcome.initial_penetration);
  }
  std::printf("%-15s %8.3f %% %8.3f deg %8.3f mm", stable_share(study, outcomes, any).c_str(), median(translation),
              median(rotation), median(penetration));
}

// No penetration as a wish, at several tolerances.
void guidance(const Study& study) {
  std::printf("%-10s  %-15s %10s %12s %11s\n", "tolerance", "% stable", "median", "", "penetration");
  for (const double tolerance : {0.0, 1e-3, 2e-4, 5e-5}) {
    std::vector<PlacementProblem> problems = study.problems();
    if (tolerance > 0)
      for (PlacementProblem& p : problems) p.guides = {no_penetration(p.context, *p.query, tolerance)};
    if (tolerance > 0)
      std::printf("%7.2f mm  ", 1e3 * tolerance);
    else
      std::printf("%10s  ", "no wish");
    print_quality(study, study.outcomes(problems, {}));
    std::printf("\n");
    std::fflush(stdout);
  }
}

// Network calls, points of a cloud, and the part of the noise that is fresh at every step.
void samplers(const Study& study) {
  struct Setting {
    int steps, points;
    double freshness;
  };
  const int usual = study.model.config().points;
  std::vector<Setting> settings;
  for (const int steps : {8, 16, 25, 50, 100})
    for (const double freshness : {0.0, 0.5, 0.8, 1.0}) settings.push_back({steps, usual, freshness});
  for (const int points : {64, 96, 128, 192, 384})
    if (points != usual) settings.push_back({50, points, 1.0});
  std::printf("%5s %6s %5s  %-15s %10s %12s %11s  ms a pose\n", "steps", "points", "fresh", "% stable", "median", "",
              "penetration");
  for (const Setting& setting : settings) {
    SamplerOptions options;
    options.steps = setting.steps;
    options.points = setting.points;
    options.freshness = setting.freshness;
    options.threads = study.threads;
    const Stopwatch watch;
    const std::vector<Pose> poses = study.model.sample(study.problems(), options);
    const double ms = watch.total_ms() / static_cast<double>(poses.size());
    std::printf("%5d %6d %5.2f  ", setting.steps, setting.points, setting.freshness);
    print_quality(study, settle_placements(study.instances, poses, study.threads));
    std::printf("  %9.1f\n", ms);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::string what, model_path;
  InstanceOptions options;
  options.count = 200;
  options.seed = 987654;
  options.threads = default_threads();
  CLI::App app{"Where raw samples of a placement model fail, and what the sampler's settings are worth.",
               "sampling_study"};
  app.add_option("study", what)->required()->check(CLI::IsMember({"starts", "guidance", "samplers"}));
  app.add_option("--model", model_path, "a model file; default: the shipped one");
  app.add_option("--context", options.context, "objects besides the query")
      ->check(CLI::Range(1, 5))
      ->capture_default_str();
  app.add_option("--instances", options.count)->check(CLI::Range(1, 10'000'000))->capture_default_str();
  app.add_option("--seed", options.seed, "of scenes and samples")->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  return run_program(app, argc, argv, [&] {
    const Study study{PlacementModel::load(model_path.empty() ? default_model_path() : model_path),
                      make_instances(options), options.seed, options.threads};
    if (what == "starts") starts(study);
    if (what == "guidance") guidance(study);
    if (what == "samplers") samplers(study);
  });
}
