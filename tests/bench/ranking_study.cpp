// What ranking by probability is worth: success in the true scene of the placement that each ranking puts first.
//
//   ranking_study --scenes 300 --seed S [--unknown] [--threads N]     the table
//   ranking_study --errors 60 --seed S [--unknown]                    the errors of recovery that apps/uncertainty.h names
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <mutex>

#include "apps/assets.h"
#include "apps/program.h"
#include "apps/ranking.h"
#include "perception/seen_surface.h"
#include "recovery_trials.h"
#include "stability/generation.h"
#include "stability/parallel_for.h"
#include "stability/sdf.h"

using namespace dofusion;

namespace {

struct StudyOptions {
  int scenes = 60, errors = 0, samples = 32, threads = 1;
  std::uint64_t seed = 0;
  bool unknown = false;
};

// A scene of one or two blocks, in turn one, two touching, two stacked; the query is one of the seven blocks.
struct RankingTrial {
  Scene truth;
  SyntheticView view;
  ObjectPtr query;
  RecoveredScene recovered;
  Pose T_true_recovered = Pose::Identity();
};

RankingTrial make_ranking_trial(const StudyOptions& options, int index) {
  TrialOptions trial_options;
  trial_options.objects = 1 + (index % 3 + 1) / 2;
  trial_options.seed = options.seed;
  const Trial seen = make_trial(trial_options, index);
  RankingTrial trial{seen.truth, seen.seen.front(), nullptr, {}, Pose::Identity()};
  Rng rng = make_rng(options.seed ^ 0x7175657279ull, static_cast<std::uint64_t>(index));
  const std::vector<ObjectPtr> blocks = all_blocks();
  trial.query = blocks[static_cast<std::size_t>(uniform_int(rng, 0, static_cast<int>(blocks.size()) - 1))];
  SceneRecoveryOptions recovery;
  if (!options.unknown) recovery.library = blocks;
  trial.recovered = recover_scene(trial.view.depth, default_camera(), recovery);
  if (trial.recovered.table)
    trial.T_true_recovered = trial.view.T_world_camera * trial.recovered.table->T_world_camera.inverse();
  return trial;
}

bool stands_in_truth(const RankingTrial& trial, const Pose& T_recovered_query) {
  PlacementOptions options;
  options.polish = false;
  options.trials = 0;
  return check_placements(trial.truth, trial.query, {trial.T_true_recovered * T_recovered_query}, options)
      .front()
      .stable;
}

enum Ranking { kProbability, kRobustness, kOneSimulation, kRandom, kBestPossible, kRankings };
const char* const kNames[] = {"the probability over drawn scenes", "stands when disturbed, one scene", "one simulation",
                              "a random candidate, as sampled", "any of the candidates (upper bound)"};

struct Outcome {
  bool stood[kRankings] = {};
  double probability = 0.0;  // of the first, as estimated
  double ms_rank = 0.0;
};

Outcome run(const StudyOptions& options, const PlacementModel& model, int index) {
  Outcome outcome;
  const RankingTrial trial = make_ranking_trial(options, index);
  if (!trial.recovered.table) return outcome;
  PlacementOptions placing;
  placing.samples = options.samples;
  placing.seed = make_rng(options.seed ^ 0x706c616365ull, static_cast<std::uint64_t>(index))();
  std::vector<Placement> placements = place(trial.recovered.scene, trial.query, model, placing);
  outcome.stood[kRobustness] = stands_in_truth(trial, placements.front().T_world_query);
  const auto movement = [](const Placement& p) {
    return std::max(p.displacement.translation_pct / kStableTranslationPct, p.displacement.rotation_deg / kStableRotationDeg);
  };
  const auto stillest = std::min_element(placements.begin(), placements.end(), [&](const Placement& a, const Placement& b) {
    return a.stable != b.stable ? a.stable : movement(a) < movement(b);
  });
  outcome.stood[kOneSimulation] = stands_in_truth(trial, stillest->T_world_query);
  Rng rng = make_rng(options.seed ^ 0x616e79ull, static_cast<std::uint64_t>(index));
  const int any = uniform_int(rng, 0, static_cast<int>(placements.size()) - 1);
  outcome.stood[kRandom] = stands_in_truth(trial, placements[static_cast<std::size_t>(any)].T_world_sampled);

  const SceneSampler sampler(trial.recovered, {}, {}, placing.seed);
  RankingOptions ranking;
  ranking.seed = placing.seed;
  const auto begin = std::chrono::steady_clock::now();
  rank_by_probability(sampler, trial.query, ranking, placements);
  outcome.ms_rank = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  outcome.stood[kProbability] = stands_in_truth(trial, placements.front().T_world_query);
  outcome.probability = placements.front().stable_probability.value_or(0.0);
  outcome.stood[kBestPossible] = std::any_of(placements.begin(), placements.end(), [&](const Placement& p) {
    return stands_in_truth(trial, p.T_world_query);
  });
  return outcome;
}

// Wilson's 95 % interval of a share.
Interval wilson(int successes, int n) {
  const double z = 1.96, p = static_cast<double>(successes) / n, zz = z * z / n;
  const double middle = (p + zz / 2.0) / (1.0 + zz), half = z * std::sqrt(p * (1.0 - p) / n + zz / 4.0 / n) / (1.0 + zz);
  return {100.0 * (middle - half), 100.0 * (middle + half)};
}

void study(const StudyOptions& options) {
  const PlacementModel model = PlacementModel::load(default_model_path());
  std::vector<Outcome> outcomes(static_cast<std::size_t>(options.scenes));
  Progress progress("scenes", options.scenes);
  std::atomic<int> done{0};
  parallel_for(options.scenes, options.threads, [&](std::int64_t i, int) {
    if (interrupted()) throw Interrupted("interrupted");
    outcomes[static_cast<std::size_t>(i)] = run(options, model, static_cast<int>(i));
    progress.update(++done);
  });
  std::printf("%s objects, %d scenes, %d candidates, seed %llu: stable in the true scene\n",
              options.unknown ? "unknown" : "known", options.scenes, options.samples,
              static_cast<unsigned long long>(options.seed));
  for (int r = 0; r < kRankings; ++r) {
    const int stood = static_cast<int>(std::count_if(outcomes.begin(), outcomes.end(), [&](const Outcome& o) { return o.stood[r]; }));
    const Interval interval = wilson(stood, options.scenes);
    std::printf("  %-36s %5.1f %% [%.1f, %.1f]\n", kNames[r], 100.0 * stood / options.scenes, interval.low, interval.high);
  }
  double ms = 0.0, promised = 0.0;
  for (const Outcome& o : outcomes) ms += o.ms_rank / options.scenes, promised += o.probability / options.scenes;
  std::printf("  mean probability of the first %.3f; ranking %.0f ms a scene on one thread\n", promised, ms);
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    if (!outcomes[i].stood[kProbability]) std::printf("  fell: scene %zu, probability %.3f\n", i, outcomes[i].probability);
  }
}

void print_quantiles(const char* what, std::vector<double> values, double unit) {
  if (values.empty()) return;
  std::sort(values.begin(), values.end());
  std::printf("  %-40s n %zu:", what, values.size());
  for (const double q : {0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95}) {
    std::printf(" %8.3f", unit * values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))]);
  }
  std::printf("\n");
}

// How far points on the faces of unknown objects are from the true surface, positive outside of it.
void face_errors(const RankingTrial& trial, std::size_t i, std::vector<double>& seen, std::vector<double>& hidden, Rng& rng) {
  const RecoveredObject& object = trial.recovered.objects[i];
  const Pose T_true_object = trial.T_true_recovered * object.T_world_object;
  std::size_t nearest = 0;
  double least = 0.05;
  for (std::size_t k = 0; k < trial.truth.objects.size(); ++k) {
    const double apart = (trial.truth.T_world_object[k].translation() - T_true_object.translation()).norm();
    if (apart < least) least = apart, nearest = k;
  }
  if (least >= 0.05) return;
  const MeshDistance distance(trial.truth.objects[nearest]->mesh);
  const Pose T_truth_object = trial.truth.T_world_object[nearest].inverse() * T_true_object;
  const std::vector<float> shares = seen_shares(object, trial.recovered.views);
  const TriangleMesh& mesh = object.object->mesh;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    TriangleMesh one;
    for (int k = 0; k < 3; ++k) one.vertices.push_back(mesh.vertices[mesh.triangles[t][k]]);
    one.triangles = {{0, 1, 2}};
    const int count = static_cast<int>(surface_area(one) / 2e-5);  // a point every 4.5 mm
    for (const SurfaceSample& sample : sample_surface(one, count, rng)) {
      if ((T_true_object.linear() * sample.normal).z() < -0.9) continue;  // what it lies on is known
      (shares[t] > 0.3f ? seen : hidden).push_back(distance(T_truth_object * sample.point));
    }
  }
}

void errors(const StudyOptions& options) {
  std::vector<double> seen, hidden, shift, turn, height, tilt;
  std::mutex mutex;
  parallel_for(options.errors, options.threads, [&](std::int64_t index, int) {
    const RankingTrial trial = make_ranking_trial(options, static_cast<int>(index));
    if (!trial.recovered.table) return;
    Rng rng = make_rng(options.seed, static_cast<std::uint64_t>(index));
    const std::lock_guard<std::mutex> lock(mutex);
    const Eigen::Vector3d centre = scene_centre(trial.truth);
    const Pose T_recovered_true = trial.T_true_recovered.inverse();
    height.push_back((T_recovered_true * Eigen::Vector3d(centre.x(), centre.y(), 0.0)).z());
    tilt.push_back(std::acos(std::min(1.0, trial.T_true_recovered.linear()(2, 2))));
    if (options.unknown) {
      for (std::size_t i = 0; i < trial.recovered.objects.size(); ++i) face_errors(trial, i, seen, hidden, rng);
      return;
    }
    std::vector<RecoveredObject> objects = trial.recovered.objects;
    for (RecoveredObject& object : objects) object.T_world_object = trial.T_true_recovered * object.T_world_object;
    for (const ObjectError& e : known_errors(trial.truth, objects)) {
      if (!e.matched || !e.right_shape) continue;
      shift.push_back(e.translation);
      turn.push_back(e.angle);
    }
  });
  std::printf("quantiles                                            5 %%      10 %%      25 %%      50 %%      75 %%      90 %%      95 %%\n");
  print_quantiles("table height at the objects, mm", height, 1000.0);
  print_quantiles("table tilt, degrees", tilt, 180.0 / M_PI);
  print_quantiles("known: position, mm", shift, 1000.0);
  print_quantiles("known: angle, degrees", turn, 180.0 / M_PI);
  print_quantiles("unknown: seen faces, mm", seen, 1000.0);
  print_quantiles("unknown: hidden faces, mm", hidden, 1000.0);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Success in the true scene of the placement ranked first.", "ranking_study"};
  StudyOptions options;
  app.add_option("--scenes", options.scenes)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--errors", options.errors, "print recovery's errors over so many scenes instead")->check(CLI::PositiveNumber);
  app.add_option("--samples", options.samples, "candidates")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--seed", options.seed)->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_flag("--unknown", options.unknown, "nothing is known of the objects on the table");
  return run_program(app, argc, argv, [&] {
    if (options.errors > 0)
      errors(options);
    else
      study(options);
  });
}
