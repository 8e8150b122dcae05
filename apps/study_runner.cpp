#include "apps/study_runner.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apps/assets.h"
#include "apps/program.h"
#include "apps/ranking.h"
#include "apps/stopwatch.h"
#include "apps/uncertainty.h"
#include "apps/wishes.h"
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

// A placement that is not what was wished is not carried out: it has no outcome.
Outcome outcome_of(const Placement& placement) {
  Outcome outcome;
  if (!placement.unmet.empty()) return outcome;
  outcome.stable = placement.stable;
  if (placement.status == SettleStatus::kDiverged) return outcome;
  outcome.pct = placement.displacement.translation_pct;
  outcome.deg = placement.displacement.rotation_deg;
  return outcome;
}

// The query put at exactly this pose.
Placement settle_at(const Scene& scene, const ObjectPtr& query, const Pose& T_world_query) {
  PlacementOptions options;
  options.polish = false;
  options.trials = 0;
  return check_placements(scene, query, {T_world_query}, options).front();
}

Pose believed_pose(const SyntheticView& view) {
  return view.believed ? view.believed->T_world_camera : view.T_world_camera;
}

std::int64_t fewest_pixels(const Scan& scan, std::size_t objects) {
  std::vector<std::int64_t> pixels(objects, 0);
  for (const std::uint8_t label : scan.labels.pixels)
    if (label >= 2) ++pixels[label - 2u];
  return *std::min_element(pixels.begin(), pixels.end());
}

std::size_t highest_object(const Scene& scene) {
  const auto top = [&](std::size_t i) {
    double z = 0.0;
    for (const Eigen::Vector3d& v : scene.objects[i]->mesh.vertices) z = std::max(z, (scene.T_world_object[i] * v).z());
    return z;
  };
  std::size_t highest = 0;
  for (std::size_t i = 1; i < scene.objects.size(); ++i)
    if (top(i) > top(highest)) highest = i;
  return highest;
}

// The object of `scene` nearest to where the wished one stands in truth; none in an empty scene.
std::optional<int> nearest_object(const Scene& scene, const Eigen::Vector3d& point) {
  std::optional<int> nearest;
  const auto distance = [&](int i) {
    return (scene.T_world_object[static_cast<std::size_t>(i)].translation() - point).norm();
  };
  for (int i = 0; i < static_cast<int>(scene.objects.size()); ++i)
    if (!nearest || distance(i) < distance(*nearest)) nearest = i;
  return nearest;
}

// Sampled and settled, each with the wishes that it does not meet.
std::vector<Placement> place_with_wishes(const Scene& scene, const ObjectPtr& query, const Wishes& wishes,
                                         const PlacementModel& model, PlacementOptions options) {
  const WishScene wished{scene, query, default_camera(), Pose::Identity()};
  steer(wishes, wished, options);
  std::vector<Placement> placements = place(scene, query, model, options);
  for (Placement& placement : placements) placement.unmet = unmet(wishes, wished, placement);
  std::stable_partition(placements.begin(), placements.end(), [](const Placement& p) { return p.unmet.empty(); });
  return placements;
}

// As dofusion-place does: ranked by how probably they stand in what the scene may really be.
std::vector<Placement> place_ranked(const RecoveredScene& recovered, const ObjectPtr& query, const Wishes& wishes,
                                    const PlacementModel& model, const PlacementOptions& options) {
  std::vector<Placement> placements = place_with_wishes(recovered.scene, query, wishes, model, options);
  stop_if_interrupted();
  const SceneSampler scenes(recovered, options.physics, {}, options.seed);
  RankingOptions ranking;
  ranking.seed = options.seed;
  rank_by_probability(scenes, query, ranking, placements);
  return placements;
}

// The first placement, in the recovered scene and put into the true one.
void settle_in_both(const StudyScene& scene, const std::vector<Placement>& placements, StudyTrial& trial) {
  StudyRow& row = trial.row;
  row.candidates_stable = static_cast<int>(std::count_if(
      placements.begin(), placements.end(), [](const Placement& p) { return p.stable && p.unmet.empty(); }));
  trial.best = placements.front();
  if (!trial.best->unmet.empty()) return;
  const Outcome seen = outcome_of(*trial.best);
  row.displacement_recovered_pct = seen.pct;
  row.displacement_recovered_deg = seen.deg;
  row.stable_recovered = seen.stable;
  Placement put = settle_at(scene.truth, scene.query, trial.T_true_recovered * trial.best->T_world_query);
  const Outcome real = outcome_of(put);
  row.displacement_true_pct = real.pct;
  row.displacement_true_deg = real.deg;
  row.stable_true = real.stable;
  trial.settled_true = std::move(put.settled);
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

  // The same viewing directions in all trials of a scene.
  std::vector<SyntheticView> scan(const StudyScene& scene, const StudyCondition& condition, double noise_scale) const {
    SyntheticViewOptions options;
    options.viewpoint.distance = condition.distance_m;
    options.sensor = condition.sensor;
    options.noise_scale = noise_scale;
    options.miscalibration.rotation_deg = condition.pose_error_deg;
    options.miscalibration.translation = 1e-3 * condition.pose_error_mm;
    std::vector<SyntheticView> views;
    for (int v = 0; v < condition.views; ++v) {
      const std::uint64_t view_seed = seed ^ kViewSeed ^ (static_cast<std::uint64_t>(v) << 56);
      Rng rng = make_rng(view_seed, static_cast<std::uint64_t>(scene.index));
      views.push_back(make_synthetic_view(scene.truth, default_camera(), options, rng));
    }
    return views;
  }

  RecoveredScene recover(const std::vector<SyntheticView>& seen, bool known) const {
    SceneRecoveryOptions options;
    if (known) options.library = library;
    std::vector<View> views;
    for (const SyntheticView& view : seen) views.push_back({view.depth, default_camera(), believed_pose(view), {}});
    return recover_scene(views, options);
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
  if (impl_->config.tasks[task].on_top) scene.on = highest_object(scene.truth);
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

  row.on_top = scene.on.has_value();
  Wishes wishes;
  if (scene.on) wishes.on_object = static_cast<int>(*scene.on);
  const std::vector<Placement> informed = place_with_wishes(
      scene.truth, scene.query, wishes, impl_->models.of(impl_->config.base()), impl_->placement_options(scene.index));
  const Outcome best = outcome_of(informed.front());
  row.displacement_ground_truth_pct = best.pct;
  row.displacement_ground_truth_deg = best.deg;
  row.stable_ground_truth = best.stable;

  Rng rng = make_rng(impl_->seed ^ kRandomSeed, static_cast<std::uint64_t>(scene.index));
  const Outcome random =
      outcome_of(settle_at(scene.truth, scene.query, random_placement(scene.truth, *scene.query, scene.task, rng)));
  row.displacement_random_pct = random.pct;
  row.displacement_random_deg = random.deg;
  row.stable_random = random.stable;
  return row;
}

StudyTrial StudyRunner::run(const StudyScene& scene, std::int64_t trial, const StudyRow& reference) const {
  stop_if_interrupted();
  StudyTrial result;
  StudyRow& row = result.row = reference;
  const StudyCondition& condition = set_condition(trial, row);
  result.views = impl_->scan(scene, condition, row.noise_scale);
  row.fewest_pixels = fewest_pixels(result.views.front().truth, scene.truth.objects.size());
  stop_if_interrupted();

  Stopwatch watch;
  result.recovered = impl_->recover(result.views, condition.known);
  row.ms_recover = watch.lap_ms();
  stop_if_interrupted();
  if (result.recovered.table) {
    // A robot has poses relative to its camera: what it believes of the camera links the recovered world with the true
    // one.
    result.T_true_recovered = believed_pose(result.views.front()) * result.recovered.table->T_world_camera.inverse();
    measure_table(result.T_true_recovered, row);
    measure_recovery(scene.truth, transformed(result.T_true_recovered, result.recovered.scene), row.known, row);
    watch.lap_ms();
    Wishes wishes;
    if (scene.on) {
      const Eigen::Vector3d there = scene.truth.T_world_object[*scene.on].translation();
      wishes.on_object = nearest_object(result.recovered.scene, result.T_true_recovered.inverse() * there);
    }
    const std::vector<Placement> placements = place_ranked(
        result.recovered, scene.query, wishes, impl_->models.of(condition), impl_->placement_options(scene.index));
    row.ms_place = watch.lap_ms();
    settle_in_both(scene, placements, result);
  }
  row.failure = first_failure(row);
  return result;
}

// Which of its scene's trials it is.
const StudyCondition& StudyRunner::set_condition(std::int64_t trial, StudyRow& row) const {
  const std::vector<double>& scales = impl_->config.noise_scales;
  const auto of_scene = static_cast<std::size_t>(trial % impl_->config.trials_per_scene());
  row.trial = trial;
  row.series = static_cast<int>(of_scene / scales.size());
  row.noise_scale = scales[of_scene % scales.size()];
  const StudyCondition& condition = impl_->config.series[static_cast<std::size_t>(row.series)];
  row.sensor = to_string(condition.sensor);
  row.distance_m = condition.distance_m;
  row.views = condition.views;
  row.pose_error_deg = condition.pose_error_deg;
  row.pose_error_mm = condition.pose_error_mm;
  row.known = condition.known;
  return condition;
}

std::vector<ObjectPtr> load_block_library() {
  std::vector<ObjectPtr> library;
  for (const std::string& name : block_names()) {
    library.push_back(make_object(name, read_solid_mesh(assets_directory() + "/blocks/" + name + ".obj")).object);
  }
  return library;
}

}  // namespace dofusion
