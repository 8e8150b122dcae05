// What --refine is worth: the error of a noisy pose before and after, on synthetic scenes of two and three blocks, the
// last of which is the query.
//
//   refine_study --scenes 100 --seed S [--shift-mm 10] [--turn-deg 10] [--sigmas 0.1 0.3]
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "apps/assets.h"
#include "apps/program.h"
#include "apps/refine.h"
#include "stability/generation.h"
#include "stability/mesh_symmetry.h"
#include "stability/parallel_for.h"

using namespace dofusion;

namespace {

struct RefineOptions {
  int scenes = 60, threads = 1;
  std::uint64_t seed = 0;
  double shift_mm = 10.0, turn_deg = 10.0;
  std::vector<double> sigmas = {kRefineSigma};
};

struct Error {
  double mm = 0.0, deg = 0.0;
  bool stable = false;
};

Error error_of(const Object& object, const Pose& T_true, const Pose& T_found) {
  Error error{1000.0 * (T_true.translation() - T_found.translation()).norm(), 180.0, false};
  for (const Eigen::Matrix3d& symmetry : rotation_symmetries(object.mesh)) {
    const double angle = rotation_angle(T_true.linear().transpose() * T_found.linear() * symmetry);
    error.deg = std::min(error.deg, angle * 180.0 / M_PI);
  }
  return error;
}

struct Row {
  Error before;
  std::vector<Error> agreed, nearest;  // for each noise scale
};

Row run(const RefineOptions& options, const PlacementModel& model, int index) {
  GenerationOptions generation;
  generation.objects = 2 + index % 2;
  generation.seed = options.seed;
  SceneGenerator generator(generation);
  SceneDataset shapes;
  shapes.shapes = generator.shapes();
  Scene scene = to_scene(shapes, generator.generate(index));
  const ObjectPtr query = scene.objects.back();
  const Pose truth = scene.T_world_object.back();
  scene.objects.pop_back();
  scene.T_world_object.pop_back();
  Rng rng = make_rng(options.seed, 5000000 + static_cast<std::uint64_t>(index));
  // The given figures are the lengths' root mean squares.
  const Eigen::Vector3d shift = normal3(rng, 0.001 * options.shift_mm / std::sqrt(3.0));
  const Eigen::Vector3d turn = normal3(rng, options.turn_deg * M_PI / 180.0 / std::sqrt(3.0));
  const Pose estimate = make_pose(so3_exp(turn) * truth.linear(), truth.translation() + shift);
  Row row{error_of(*query, truth, estimate), {}, {}};
  const std::vector<Eigen::Matrix3d> symmetries = rotation_symmetries(query->mesh);
  for (const double sigma : options.sigmas) {
    PlacementOptions placing;
    placing.start = estimate;
    placing.start_sigma = sigma;
    placing.trials = 0;
    placing.seed = static_cast<std::uint64_t>(index);
    std::vector<Placement> placements = place(scene, query, model, placing);
    rank_by_agreement(*query, estimate, placements);
    const auto added = [&](const Placement& p) {
      Error error = error_of(*query, truth, p.T_world_query);
      error.stable = p.stable;
      return error;
    };
    row.agreed.push_back(added(placements.front()));
    const auto distance = [&](const Placement& p) {
      return (p.stable ? 0.0 : 1e6) + pose_distance(*query, symmetries, p.T_world_query, estimate);
    };
    row.nearest.push_back(added(*std::min_element(
        placements.begin(), placements.end(), [&](const auto& a, const auto& b) { return distance(a) < distance(b); })));
  }
  return row;
}

void print(const std::string& what, const std::vector<Error>& errors) {
  std::vector<double> mm, deg;
  int stable = 0, within = 0;
  for (const Error& e : errors) {
    mm.push_back(e.mm), deg.push_back(e.deg);
    stable += e.stable ? 1 : 0;
    within += e.mm < 5.0 && e.deg < 5.0 ? 1 : 0;
  }
  const auto n = static_cast<double>(errors.size());
  std::printf("%-28s %6.2f mm %6.2f deg  within 5 mm and 5 deg %5.1f %%  stable %5.1f %%\n", what.c_str(), median(mm),
              median(deg), 100.0 * within / n, 100.0 * stable / n);
}

void study(const RefineOptions& options) {
  const PlacementModel model = PlacementModel::load(default_model_path());
  std::vector<Row> rows(static_cast<std::size_t>(options.scenes));
  Progress progress("scenes", options.scenes);
  std::atomic<int> done{0};
  parallel_for(options.scenes, options.threads, [&](std::int64_t i, int) {
    if (interrupted()) throw Interrupted("interrupted");
    rows[static_cast<std::size_t>(i)] = run(options, model, static_cast<int>(i));
    progress.update(++done);
  });
  std::printf("%d scenes, seed %llu, estimates off by %g mm and %g degrees (root mean square); medians\n", options.scenes,
              static_cast<unsigned long long>(options.seed), options.shift_mm, options.turn_deg);
  std::vector<Error> errors;
  for (const Row& row : rows) errors.push_back(row.before);
  print("before", errors);
  for (std::size_t s = 0; s < options.sigmas.size(); ++s) {
    std::vector<Error> agreed, nearest;
    for (const Row& row : rows) agreed.push_back(row.agreed[s]), nearest.push_back(row.nearest[s]);
    char what[64];
    std::snprintf(what, sizeof what, "noise %g, most agreed on", options.sigmas[s]);
    print(what, agreed);
    std::snprintf(what, sizeof what, "noise %g, nearest", options.sigmas[s]);
    print(what, nearest);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Error of a noisy pose before and after --refine.", "refine_study"};
  RefineOptions options;
  app.add_option("--scenes", options.scenes)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--seed", options.seed)->capture_default_str();
  app.add_option("--shift-mm", options.shift_mm, "root mean square distance of the estimates")->capture_default_str();
  app.add_option("--turn-deg", options.turn_deg, "root mean square angle")->capture_default_str();
  app.add_option("--sigmas", options.sigmas, "noise scales at the start")->capture_default_str();
  app.add_option("--threads", options.threads)->check(CLI::PositiveNumber)->capture_default_str();
  return run_program(app, argc, argv, [&] { study(options); });
}
