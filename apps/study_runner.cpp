#include "apps/study_runner.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apps/assets.h"
#include "apps/pipeline.h"
#include "apps/placement.h"
#include "apps/program.h"
#include "apps/stopwatch.h"
#include "perception/synthetic_view.h"
#include "stability/generation.h"
#include "stability/mesh_io.h"
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

}  // namespace

std::string model_path(const StudyCondition& condition) {
  return condition.model.empty() ? default_model_path() : condition.model;
}

StudyModels::StudyModels(const StudyConfig& config) {
  for (const StudyCondition& condition : config.series) {
    const std::string path = model_path(condition);
    if (models_.count(path) == 0) models_.emplace(path, PlacementModel::load(path));
  }
}

const PlacementModel& StudyModels::of(const StudyCondition& condition) const {
  return models_.at(model_path(condition));
}

struct StudyRunner::Impl {
  StudyConfig config;
  std::uint64_t seed;
  const StudyModels& models;
  std::vector<ObjectPtr> library;
  std::vector<std::unique_ptr<SceneGenerator>> generators;  // one per task

  PlacementOptions placement_options(std::int64_t scene) const {
    PlacementOptions options;
    options.samples = config.samples;
    options.steps = config.steps;
    options.seed = make_rng(seed ^ kPlacementSeed, static_cast<std::uint64_t>(scene))();
    return options;
  }

  // The same viewing direction in all trials of a scene.
  SyntheticView scan(const StudyScene& scene, const StudyCondition& condition, double noise_scale) const {
    SyntheticViewOptions options;
    options.viewpoint.distance = condition.distance_m;
    options.sensor = condition.sensor;
    options.noise_scale = noise_scale;
    Rng rng = make_rng(seed ^ kViewSeed, static_cast<std::uint64_t>(scene.index));
    return make_synthetic_view(scene.truth, default_camera(), options, rng);
  }

  RecoveredScene recover(const SyntheticView& view, bool known) const {
    SceneRecoveryOptions options;
    if (known) options.library = library;
    return recover_scene(view.depth, default_camera(), options);
  }
};

StudyRunner::StudyRunner(const StudyConfig& config, std::uint64_t seed, const StudyModels& models,
                         std::vector<ObjectPtr> library)
    : impl_(new Impl{config, seed, models, std::move(library), {}}) {
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
  row.task = to_string(scene.task);
  row.context = joined_names(scene.truth.objects);
  row.query = scene.query->name;
  row.objects_true = static_cast<int>(scene.truth.objects.size());

  const std::vector<Placement> informed =
      place(scene.truth, scene.query, impl_->models.of(impl_->config.base()), impl_->placement_options(scene.index));
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
  stop_if_interrupted();
  const std::vector<double>& scales = impl_->config.noise_scales;
  const auto of_scene = static_cast<std::size_t>(trial % impl_->config.trials_per_scene());
  row.trial = trial;
  row.series = static_cast<int>(of_scene / scales.size());
  row.noise_scale = scales[of_scene % scales.size()];
  const StudyCondition& condition = impl_->config.series[static_cast<std::size_t>(row.series)];
  row.sensor = to_string(condition.sensor);
  row.distance_m = condition.distance_m;
  row.known = condition.known;

  const SyntheticView view = impl_->scan(scene, condition, row.noise_scale);
  std::vector<std::int64_t> pixels(scene.truth.objects.size(), 0);
  for (const std::uint8_t label : view.truth.labels.pixels) {
    if (label >= 2) ++pixels[label - 2u];
  }
  row.fewest_pixels = *std::min_element(pixels.begin(), pixels.end());
  stop_if_interrupted();

  Stopwatch watch;
  const RecoveredScene recovered = impl_->recover(view, condition.known);
  row.ms_recover = watch.lap_ms();
  stop_if_interrupted();
  if (recovered.table) {
    // A robot has poses relative to its camera: the camera links the recovered world with the true one.
    const Pose T_true_recovered = view.T_world_camera * recovered.table->T_world_camera.inverse();
    measure_table(T_true_recovered, row);
    measure_recovery(scene.truth, transformed(T_true_recovered, recovered.scene), row.known, row);

    watch.lap_ms();
    const std::vector<Placement> placements =
        place(recovered.scene, scene.query, impl_->models.of(condition), impl_->placement_options(scene.index));
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

}  // namespace dofusion
