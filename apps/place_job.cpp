#include "apps/place_job.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/assets.h"
#include "apps/place_report.h"
#include "apps/place_scene.h"
#include "apps/program.h"
#include "apps/ranking.h"
#include "apps/stopwatch.h"
#include "perception/depth_io.h"
#include "perception/mesh_sdf.h"
#include "perception/seen_surface.h"
#include "stability/files.h"
#include "stability/mesh_io.h"
#include "stability/mjcf.h"

namespace dofusion {
namespace fs = std::filesystem;
namespace {

nlohmann::json matrix(const Pose& pose) {
  nlohmann::json rows = nlohmann::json::array();
  for (int r = 0; r < 4; ++r) {
    rows.push_back({pose.matrix()(r, 0), pose.matrix()(r, 1), pose.matrix()(r, 2), pose.matrix()(r, 3)});
  }
  return rows;
}

nlohmann::json number_or_null(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

std::string object_file(std::size_t index) { return "objects/" + std::to_string(index) + ".obj"; }

// How many placements do not meet which wish.
std::map<std::string, int> failures(const std::vector<Placement>& placements) {
  std::map<std::string, int> counts;
  for (const Placement& placement : placements) {
    for (const std::string& wish : placement.unmet) ++counts[wish];
  }
  return counts;
}

nlohmann::json wishes_json(const Wishes& wishes, const std::vector<Placement>& placements) {
  const auto met = std::count_if(placements.begin(), placements.end(),
                                 [](const Placement& p) { return p.stable && p.unmet.empty(); });
  return {{"asked", to_string(wishes)}, {"stable_and_met", met}, {"unmet", failures(placements)}};
}

std::string scene_xml(const PlaceInputs& inputs, const PlaceResult& result, const PhysicsOptions& physics) {
  Scene scene = result.recovered.scene;
  MjcfOptions mjcf;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) mjcf.mesh_files.push_back(object_file(i));
  if (!result.placements.empty()) {
    scene.objects.push_back(inputs.query);
    scene.T_world_object.push_back(result.placements.front().T_world_query);
    mjcf.mesh_files.emplace_back("query.obj");
  }
  return mjcf_text(scene.objects, scene.T_world_object, physics, mjcf);
}

// A few at a time, between which a signal is seen.
std::vector<Pose> sample_interruptibly(const PlacementModel& model, const std::vector<PlacementProblem>& problems,
                                       const SamplerOptions& options) {
  constexpr std::size_t kAtOnce = 64;
  std::vector<Pose> poses;
  for (std::size_t first = 0; first < problems.size(); first += kAtOnce) {
    if (interrupted()) throw Interrupted("interrupted");
    const auto begin = problems.begin() + static_cast<std::ptrdiff_t>(first);
    const std::vector<PlacementProblem> some(begin, begin + static_cast<std::ptrdiff_t>(std::min(kAtOnce, problems.size() - first)));
    for (const Pose& pose : model.sample(some, options)) poses.push_back(pose);
  }
  return poses;
}

constexpr int kRounds = 3;     // of candidates, while few of them meet what is wished
constexpr int kEnough = 4;     // that do

bool too_few(const Wishes& wishes, const std::vector<Placement>& placements) {
  if (!wishes.any()) return false;
  return std::count_if(placements.begin(), placements.end(),
                       [](const Placement& p) { return p.stable && p.unmet.empty(); }) < kEnough;
}

// The sampler's options, steered towards what is wished and what is estimated.
PlacementOptions with_wishes(const PlaceArguments& arguments, const WishScene& scene,
                             const std::optional<Pose>& T_world_estimate) {
  PlacementOptions options = arguments.placement;
  options.start = T_world_estimate;
  if (T_world_estimate) options.start_sigma = arguments.refine_noise;
  steer(arguments.wishes, scene, options);
  return options;
}

}  // namespace

bool found_placement(const PlaceResult& result) {
  return !result.placements.empty() && result.placements.front().stable && result.placements.front().unmet.empty();
}

PlaceResult run_placement(const PlaceInputs& inputs, const PlaceArguments& arguments) {
  PlaceResult result;
  SceneRecoveryOptions recovery;
  recovery.library = inputs.library;
  recovery.mask = inputs.mask;
  recovery.physics = arguments.placement.physics;
  recovery.threads = arguments.placement.threads;
  const std::string model_file = arguments.model.empty() ? default_model_path() : arguments.model;
  const PlacementModel model = PlacementModel::load(model_file);
  detail("model: " + model_file);
  std::vector<View> views = {{inputs.depth, inputs.camera, inputs.T_given_camera.value_or(Pose::Identity()), {}}};
  views.insert(views.end(), inputs.more_views.begin(), inputs.more_views.end());
  result.recovered = recover_scene(views, recovery);
  const auto recovered_ms = [&](const char* step) {
    const auto found = result.recovered.timing_ms.find(step);
    return found == result.recovered.timing_ms.end() ? 0.0 : found->second;
  };
  result.timing_ms = {{"segment", recovered_ms("segment")}, {"recover", recovered_ms("recover")}};
  for (std::size_t i = 0; i < result.recovered.objects.size(); ++i) {
    const RecoveredObject& object = result.recovered.objects[i];
    detail("object " + std::to_string(i) + ": " + object.name + ", " + std::to_string(object.pixels) + " pixels, " +
           std::to_string(std::lround(100.0 * object.score)) + " % explained");
  }
  if (!result.recovered.table) {
    for (const char* step : {"sdf", "sample", "settle"}) result.timing_ms.emplace_back(step, 0.0);
    return result;
  }

  if (inputs.estimate) {
    const bool world = inputs.estimate->name == "T_world_query";
    result.T_world_estimate =
        world ? inputs.estimate->pose : result.recovered.table->T_world_camera * inputs.estimate->pose;
    const auto itself = seen_as(result.recovered.scene, *inputs.query, *result.T_world_estimate);
    if (itself) remove_object(result.recovered, *itself);
  }
  check_wishes(arguments.wishes, result.recovered.objects.size());  // only now is it known what there is
  Stopwatch watch;
  const Scene scene = with_distance_fields(result.recovered.scene, {}, arguments.placement.threads);
  const ObjectPtr query = with_distance_field(inputs.query, {}, arguments.placement.threads);
  result.timing_ms.emplace_back("sdf", watch.lap_ms());
  const WishScene wished{scene, query, inputs.camera, result.recovered.table->T_world_camera};
  const PlacementOptions placing = with_wishes(arguments, wished, result.T_world_estimate);
  double sample_ms = 0.0, settle_ms = 0.0;
  for (int round = 0; round < kRounds && (round == 0 || too_few(arguments.wishes, result.placements)); ++round) {
    PlacementOptions now = placing;
    now.seed = round == 0 ? placing.seed : make_rng(placing.seed, 0x726f756e6400u + static_cast<unsigned>(round))();
    const std::vector<Pose> candidates =
        sample_interruptibly(model, placement_problems(scene, query, now), sampler_options(now));
    sample_ms += watch.lap_ms();
    if (interrupted()) throw Interrupted("interrupted");
    for (Placement& placement : check_placements(scene, query, candidates, now)) {
      placement.unmet = unmet(arguments.wishes, wished, placement);
      result.placements.push_back(std::move(placement));
    }
    settle_ms += watch.lap_ms();
    detail(std::to_string(candidates.size()) + " candidates sampled and settled");
  }
  result.timing_ms.emplace_back("sample", sample_ms);
  if (interrupted()) throw Interrupted("interrupted");
  const SceneSampler scenes(result.recovered, arguments.placement.physics, {}, arguments.placement.seed);
  RankingOptions ranking;
  ranking.seed = arguments.placement.seed;
  ranking.threads = arguments.placement.threads;
  rank_by_probability(scenes, inputs.query, ranking, result.placements);
  if (result.T_world_estimate) rank_by_agreement(*inputs.query, *result.T_world_estimate, result.placements);
  result.timing_ms.emplace_back("settle", settle_ms + watch.lap_ms());
  return result;
}

std::string placements_json(const PlaceInputs& inputs, const PlaceArguments& arguments, const PlaceResult& result) {
  nlohmann::ordered_json json;
  json["format"] = "dofusion-placements";
  json["version"] = 1;
  json["seed"] = arguments.placement.seed;
  const bool table = result.recovered.table.has_value();
  json["status"] = !table                                                     ? "no_table"
                   : arguments.wishes.any() && !found_placement(result)      ? "unreachable"
                   : result.recovered.objects.empty()                        ? "no_object"
                                                                             : "ok";
  const Pose T_world_camera = table ? result.recovered.table->T_world_camera : Pose::Identity();
  json["T_world_camera"] = table ? matrix(T_world_camera) : nlohmann::json();
  if (inputs.T_given_camera) {
    json["T_given_world"] = table ? matrix(*inputs.T_given_camera * T_world_camera.inverse()) : nlohmann::json();
  }
  json["objects"] = nlohmann::json::array();
  for (std::size_t i = 0; i < result.recovered.objects.size(); ++i) {
    const RecoveredObject& object = result.recovered.objects[i];
    json["objects"].push_back({{"index", i},
                               {"name", object.name},
                               {"known", object.known},
                               {"T_world_object", matrix(object.T_world_object)},
                               {"mesh", object_file(i)},
                               {"pixels", object.pixels}});
  }
  json["recovered_scene_moved"] = {{"status", to_string(result.recovered.settled)},
                                   {"translational_displacement_pct", number_or_null(result.recovered.moved_pct)},
                                   {"rotational_displacement_deg", number_or_null(result.recovered.moved_deg)}};
  if (result.T_world_estimate) json["T_world_estimate"] = matrix(*result.T_world_estimate);
  const Eigen::Vector3d& origin = inputs.query_origin;
  json["query"] = {{"name", inputs.query->name},
                   {"mesh", "query.obj"},
                   {"origin_in_file", {origin.x(), origin.y(), origin.z()}}};
  if (arguments.wishes.any()) json["wishes"] = wishes_json(arguments.wishes, result.placements);
  json["placements"] = nlohmann::json::array();
  for (std::size_t i = 0; i < result.placements.size(); ++i) {
    const Placement& placement = result.placements[i];
    json["placements"].push_back(
        {{"rank", i + 1},
         {"T_world_query", matrix(placement.T_world_query)},
         {"T_camera_query", matrix(T_world_camera.inverse() * placement.T_world_query)},
         {"stable", placement.stable},
         {"status", to_string(placement.status)},
         {"stable_probability",
          placement.stable_probability ? nlohmann::json(*placement.stable_probability) : nlohmann::json()},
         {"robustness", placement.robustness ? nlohmann::json(*placement.robustness) : nlohmann::json()},
         {"translational_displacement_pct", number_or_null(placement.displacement.translation_pct)},
         {"rotational_displacement_deg", number_or_null(placement.displacement.rotation_deg)},
         {"penetration_m", placement.penetration}});
    if (arguments.wishes.any()) json["placements"].back()["unmet"] = placement.unmet;
  }
  for (const auto& [step, ms] : result.timing_ms) json["timing_ms"][step] = std::round(ms * 10.0) / 10.0;
  // A file's name need not be UTF-8; JSON must.
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

void write_outputs(const std::string& directory, const PlaceInputs& inputs, const PlaceArguments& arguments,
                   PlaceResult& result) {
  Stopwatch watch;
  fs::create_directories(directory + "/objects");
  for (std::size_t i = 0; i < result.recovered.objects.size(); ++i) {
    const TriangleMesh& mesh = result.recovered.objects[i].object->mesh;
    const std::string file = directory + "/" + object_file(i);
    if (result.recovered.seen.empty()) {
      write_obj(mesh, file);
    } else {
      write_seen_obj(mesh, result.recovered.seen[i], file);
    }
  }
  write_obj(inputs.query->mesh, directory + "/query.obj");
  write_file(directory + "/scene.xml", scene_xml(inputs, result, arguments.placement.physics));
  LabelImage labels = result.recovered.labels;
  if (labels.pixels.empty()) labels = LabelImage(inputs.camera.width, inputs.camera.height, kLabelNothing);
  write_labels(labels, directory + "/segmentation.png");
  const std::string glb = scene_glb(inputs, result, arguments.placement);
  write_file(directory + "/scene.glb", glb);
  const ReportPictures pictures = render_pictures(inputs, result, arguments.placement.threads);
  result.timing_ms.emplace_back("report", watch.lap_ms());
  double total = 0.0;
  for (const auto& step : result.timing_ms) total += step.second;
  result.timing_ms.emplace_back("total", total);
  write_file(directory + "/placements.json", placements_json(inputs, arguments, result));
  write_file(directory + "/report.html", report_html(inputs, arguments, result, pictures, glb));
}

std::string summary_line(const PlaceInputs& inputs, const PlaceResult& result) {
  if (!result.recovered.table) return "no table was found in the image, so there is nothing to place on";
  const auto stable = std::count_if(result.placements.begin(), result.placements.end(),
                                    [](const Placement& p) { return p.stable; });
  const std::size_t n = result.recovered.objects.size();
  std::string text = n == 0 ? "no object was found on the table" : std::to_string(n) + (n == 1 ? " object" : " objects") + " recovered";
  text += "; " + std::to_string(stable) + " of " + std::to_string(result.placements.size()) + " placements of the " +
          inputs.query->name + " are stable";
  if (stable > 0) {
    const Displacement& best = result.placements.front().displacement;
    char line[96];
    std::snprintf(line, sizeof line, ", the best moves %.2f %% and %.2f degrees", best.translation_pct, best.rotation_deg);
    text += line;
  }
  return text;
}

}  // namespace dofusion
