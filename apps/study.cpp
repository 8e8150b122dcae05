#include "apps/study.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <nlohmann/json.hpp>

#include "apps/assets.h"
#include "apps/pipeline.h"
#include "apps/placement.h"
#include "apps/program.h"
#include "apps/stopwatch.h"
#include "perception/synthetic_view.h"
#include "stability/files.h"
#include "stability/generation.h"
#include "stability/mesh_io.h"
#include "stability/parallel_for.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

// Each kind of draw has its own seed; and scenes made from small seeds elsewhere, such as training sets, are not ours.
constexpr std::uint64_t kSceneSeed = 0x737475647973636eull, kQuerySeed = 0x7175657279ull, kViewSeed = 0x76696577ull,
                        kPlacementSeed = 0x706c616365ull, kRandomSeed = 0x72616e646f6dull;

void stop_if_interrupted() {
  if (interrupted()) throw Interrupted("interrupted");
}

std::string joined_names(const std::vector<ObjectPtr>& objects) {
  std::string names;
  for (const ObjectPtr& object : objects) names += (names.empty() ? "" : "+") + object->name;
  return names;
}

struct Match {
  std::size_t truth = 0, recovered = 0;
  double distance = 0.0;  // between centres, metres
};

// Pairs of nearest centres, the nearest pair first; what has no partner left stays alone.
std::vector<Match> match_nearest(const Scene& truth, const Scene& recovered) {
  std::vector<Match> pairs, matches;
  for (std::size_t t = 0; t < truth.objects.size(); ++t) {
    for (std::size_t r = 0; r < recovered.objects.size(); ++r) {
      const Eigen::Vector3d apart = truth.T_world_object[t].translation() - recovered.T_world_object[r].translation();
      pairs.push_back({t, r, apart.norm()});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const Match& a, const Match& b) { return a.distance < b.distance; });
  for (const Match& pair : pairs) {
    const bool taken = std::any_of(matches.begin(), matches.end(), [&](const Match& m) {
      return m.truth == pair.truth || m.recovered == pair.recovered;
    });
    if (!taken) matches.push_back(pair);
  }
  return matches;
}

// The largest distance from a corner of an object at one pose to the nearest corner of it at another.
double corner_distance(const Object& object, const Pose& T_world_a, const Pose& T_world_b) {
  double largest = 0.0;
  for (const Eigen::Vector3d& a : object.mesh.vertices) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& b : object.mesh.vertices) {
      nearest = std::min(nearest, (T_world_a * a - T_world_b * b).norm());
    }
    largest = std::max(largest, nearest);
  }
  return largest;
}

// How well `recovered`, in the true world frame, agrees with the truth.
void measure_recovery(const Scene& truth, const Scene& recovered, bool known, StudyRow& row) {
  row.objects_found = static_cast<int>(recovered.objects.size());
  const std::vector<Match> matches = match_nearest(truth, recovered);
  if (known) row.shapes_right = 0;
  if (matches.empty()) return;
  double sum = 0.0, largest = 0.0, worst_pct = 0.0;
  for (const Match& m : matches) {
    const Object& object = *truth.objects[m.truth];
    const bool same_shape = known && recovered.objects[m.recovered]->name == object.name;
    const double error =
        same_shape ? corner_distance(object, truth.T_world_object[m.truth], recovered.T_world_object[m.recovered])
                   : m.distance;
    if (same_shape) ++*row.shapes_right;
    worst_pct = std::max(worst_pct, 100.0 * error / object.diameter);
    sum += m.distance;
    largest = std::max(largest, m.distance);
  }
  row.position_error_mean_mm = 1000.0 * sum / static_cast<double>(matches.size());
  row.position_error_max_mm = 1000.0 * largest;
  row.pose_error_max_pct = worst_pct;
}

void measure_table(const Pose& T_true_recovered, StudyRow& row) {
  const Eigen::Vector3d up = T_true_recovered.linear().col(2);
  row.table_angle_deg = std::atan2(up.head<2>().norm(), up.z()) * 180.0 / M_PI;
  row.table_offset_mm = 1000.0 * std::abs(T_true_recovered.translation().z());
}

Scene transformed(const Pose& T_a_b, Scene scene) {
  for (Pose& pose : scene.T_world_object) pose = T_a_b * pose;
  return scene;
}

struct Outcome {
  std::optional<double> pct, deg;
  bool stable = false;
};

Outcome outcome_of(const Placement& placement) {
  Outcome outcome;
  outcome.stable = placement.stable;
  if (placement.status == SettleStatus::kDiverged) return outcome;
  outcome.pct = placement.displacement.translation_pct;
  outcome.deg = placement.displacement.rotation_deg;
  return outcome;
}

// The query put at exactly this pose.
Outcome settle_at(const Scene& scene, const ObjectPtr& query, const Pose& T_world_query) {
  PlacementOptions options;
  options.polish = false;
  options.trials = 0;
  return outcome_of(check_placements(scene, query, {T_world_query}, options).front());
}

// 64-bit FNV-1a, to tell model files apart.
std::string hash_of(const std::string& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

std::string model_path(const StudyConfig& config) { return config.model.empty() ? default_model_path() : config.model; }

using Runners = std::vector<std::unique_ptr<StudyRunner>>;

// A scene at all its noise scales is one piece of work: its references are needed once.
void run_missing_trials(const StudyJob& job, const Runners& runners, PartialRows& rows) {
  const auto scales = static_cast<std::int64_t>(job.config.noise_scales.size());
  const std::int64_t scenes = (job.trials + scales - 1) / scales;
  Progress progress("trials", job.trials, rows.count(job.trials));
  parallel_for(scenes, static_cast<int>(runners.size()), [&](std::int64_t index, int thread) {
    const std::int64_t end = std::min((index + 1) * scales, job.trials);
    std::vector<std::int64_t> missing;
    for (std::int64_t trial = index * scales; trial < end; ++trial) {
      if (!rows.has(trial)) missing.push_back(trial);
    }
    if (missing.empty()) return;
    stop_if_interrupted();
    StudyRunner& runner = *runners[static_cast<std::size_t>(thread)];
    const StudyScene scene = runner.make_scene(index);
    const StudyRow reference = runner.reference_row(scene);
    for (const std::int64_t trial : missing) {
      stop_if_interrupted();
      rows.add(runner.run(scene, trial, reference));
      progress.update(rows.count(job.trials));
    }
  });
}

}  // namespace

struct StudyRunner::Impl {
  StudyConfig config;
  std::uint64_t seed;
  const PlacementModel& model;
  std::vector<ObjectPtr> library;
  std::vector<std::unique_ptr<SceneGenerator>> generators;  // one per task

  PlacementOptions placement_options(std::int64_t scene) const {
    PlacementOptions options;
    options.samples = config.samples;
    options.steps = config.steps;
    options.seed = make_rng(seed ^ kPlacementSeed, static_cast<std::uint64_t>(scene))();
    return options;
  }

  // The same viewpoint at every noise scale of a scene.
  SyntheticView scan(const StudyScene& scene, double noise_scale) const {
    SyntheticViewOptions options;
    options.viewpoint.distance = config.distance_m;
    options.sensor = config.sensor;
    options.noise_scale = noise_scale;
    Rng rng = make_rng(seed ^ kViewSeed, static_cast<std::uint64_t>(scene.index));
    return make_synthetic_view(scene.truth, default_camera(), options, rng);
  }

  RecoveredScene recover(const SyntheticView& view) const {
    SceneRecoveryOptions options;
    if (config.known) options.library = library;
    return recover_scene(view.depth, default_camera(), options);
  }
};

StudyRunner::StudyRunner(const StudyConfig& config, std::uint64_t seed, const PlacementModel& model,
                         std::vector<ObjectPtr> library)
    : impl_(new Impl{config, seed, model, std::move(library), {}}) {
  for (const StudyTask& task : config.tasks) {
    GenerationOptions options;
    options.task = task.task;
    options.objects = task.objects;
    options.seed = seed ^ kSceneSeed;
    impl_->generators.push_back(std::make_unique<SceneGenerator>(options));
  }
}

StudyRunner::~StudyRunner() = default;

StudyScene StudyRunner::make_scene(std::int64_t index) {
  const auto task = static_cast<std::size_t>(index) % impl_->generators.size();
  SceneGenerator& generator = *impl_->generators[task];
  SceneDataset shapes;
  shapes.shapes = generator.shapes();
  StudyScene scene;
  scene.index = index;
  scene.task = impl_->config.tasks[task].task;
  scene.truth = to_scene(shapes, generator.generate(index));
  Rng rng = make_rng(impl_->seed ^ kQuerySeed, static_cast<std::uint64_t>(index));
  const int query = uniform_int(rng, 0, static_cast<int>(shapes.shapes.size()) - 1);
  scene.query = shapes.shapes[static_cast<std::size_t>(query)];
  return scene;
}

StudyRow StudyRunner::reference_row(const StudyScene& scene) const {
  StudyRow row;
  row.scene = scene.index;
  row.sensor = to_string(impl_->config.sensor);
  row.distance_m = impl_->config.distance_m;
  row.known = impl_->config.known;
  row.task = to_string(scene.task);
  row.context = joined_names(scene.truth.objects);
  row.query = scene.query->name;
  row.objects_true = static_cast<int>(scene.truth.objects.size());

  const std::vector<Placement> informed =
      place(scene.truth, scene.query, impl_->model, impl_->placement_options(scene.index));
  const Outcome best = outcome_of(informed.front());
  row.displacement_ground_truth_pct = best.pct;
  row.displacement_ground_truth_deg = best.deg;
  row.stable_ground_truth = best.stable;

  Rng rng = make_rng(impl_->seed ^ kRandomSeed, static_cast<std::uint64_t>(scene.index));
  const Outcome random =
      settle_at(scene.truth, scene.query, random_placement(scene.truth, *scene.query, scene.task, rng));
  row.displacement_random_pct = random.pct;
  row.displacement_random_deg = random.deg;
  row.stable_random = random.stable;
  return row;
}

StudyRow StudyRunner::run(const StudyScene& scene, std::int64_t trial, StudyRow row) const {
  const std::vector<double>& scales = impl_->config.noise_scales;
  row.trial = trial;
  row.noise_scale = scales[static_cast<std::size_t>(trial) % scales.size()];

  const SyntheticView view = impl_->scan(scene, row.noise_scale);
  std::vector<std::int64_t> pixels(scene.truth.objects.size(), 0);
  for (const std::uint8_t label : view.truth.labels.pixels) {
    if (label >= 2) ++pixels[label - 2u];
  }
  row.fewest_pixels = *std::min_element(pixels.begin(), pixels.end());
  stop_if_interrupted();

  Stopwatch watch;
  const RecoveredScene recovered = impl_->recover(view);
  row.ms_recover = watch.lap_ms();
  stop_if_interrupted();
  if (recovered.table) {
    // A robot has poses relative to its camera: the camera links the recovered world with the true one.
    const Pose T_true_recovered = view.T_world_camera * recovered.table->T_world_camera.inverse();
    measure_table(T_true_recovered, row);
    measure_recovery(scene.truth, transformed(T_true_recovered, recovered.scene), row.known, row);

    watch.lap_ms();
    const std::vector<Placement> placements =
        place(recovered.scene, scene.query, impl_->model, impl_->placement_options(scene.index));
    row.ms_place = watch.lap_ms();
    row.candidates_stable = static_cast<int>(
        std::count_if(placements.begin(), placements.end(), [](const Placement& p) { return p.stable; }));
    const Placement& best = placements.front();
    const Outcome seen = outcome_of(best);
    row.displacement_recovered_pct = seen.pct;
    row.displacement_recovered_deg = seen.deg;
    row.stable_recovered = seen.stable;
    const Outcome real = settle_at(scene.truth, scene.query, T_true_recovered * best.T_world_query);
    row.displacement_true_pct = real.pct;
    row.displacement_true_deg = real.deg;
    row.stable_true = real.stable;
  }
  row.failure = first_failure(row);
  return row;
}

std::vector<ObjectPtr> load_block_library() {
  std::vector<ObjectPtr> library;
  for (const std::string& name : block_names()) {
    library.push_back(make_object(name, read_solid_mesh(assets_directory() + "/blocks/" + name + ".obj")).object);
  }
  return library;
}

std::string study_settings(const StudyJob& job) {
  nlohmann::ordered_json settings = {{"format", "dofusion-study"}, {"version", 1}, {"seed", job.seed}};
  settings["configuration"] = to_json(job.config);
  settings["model_fnv1a"] = hash_of(read_file(model_path(job.config)));
  return settings.dump();
}

std::vector<StudyRow> run_study(const StudyJob& job) {
  const PlacementModel model = PlacementModel::load(model_path(job.config));
  const std::vector<ObjectPtr> library = load_block_library();
  Runners runners;
  for (int t = 0; t < job.threads; ++t) {
    runners.push_back(std::make_unique<StudyRunner>(job.config, job.seed, model, library));
  }
  PartialRows rows(job.partial, study_settings(job));
  const std::int64_t before = rows.count(job.trials);
  if (before > 0) {
    std::fprintf(stderr, "continuing with the %ld trials of %s\n", static_cast<long>(before), job.partial.c_str());
  }

  try {
    run_missing_trials(job, runners, rows);
  } catch (const Interrupted&) {
    throw Interrupted("interrupted after " + std::to_string(rows.count(job.trials)) + " of " +
                      std::to_string(job.trials) + " trials; the same command goes on from " + job.partial);
  }
  return rows.rows(job.trials);
}

}  // namespace dofusion
