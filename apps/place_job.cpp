#include "apps/place_job.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/assets.h"
#include "apps/place_report.h"
#include "apps/place_scene.h"
#include "apps/program.h"
#include "apps/stopwatch.h"
#include "perception/cloud_io.h"
#include "perception/depth_io.h"
#include "perception/mesh_sdf.h"
#include "stability/convex_parts.h"
#include "stability/files.h"
#include "stability/mesh_io.h"
#include "stability/mjcf.h"
#include "stability/shapes.h"

namespace dofusion {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kMostTriangles = 100000;        // of a mesh: beyond, finding its convex parts takes minutes

// The solid of a mesh file; `unit_option` is the argument that says its unit.
ObjectAndOffset load_solid(const std::string& file, double unit, const std::string& unit_option) {
  ObjectAndOffset solid;
  try {
    const MendedMesh mended = read_mended_mesh(file, unit);
    if (mended.holes > 0) std::fprintf(stderr, "%s\n", mending_note(file, mended).c_str());
    const TriangleMesh& mesh = mended.mesh;
    if (mesh.triangles.size() > kMostTriangles) {
      throw InputError(file + ": a mesh of " + std::to_string(mesh.triangles.size()) + " triangles; simplify it to " +
                       std::to_string(kMostTriangles) + " or fewer");
    }
    solid = make_object(fs::path(file).stem().string(), mesh);
    solid.object = with_convex_parts(solid.object);
  } catch (const std::invalid_argument& e) {
    throw InputError(file + ": " + e.what());
  }
  check_object_size(file, solid.object->diameter, unit, unit_option);
  return solid;
}

std::vector<ObjectPtr> load_library(const std::string& directory, double unit) {
  if (!fs::is_directory(directory)) throw InputError(directory + ": --objects needs a folder of mesh files");
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) {
    std::string extension = entry->path().extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(), ::tolower);
    if (extension == ".obj" || extension == ".stl" || extension == ".ply") files.push_back(entry->path());
  }
  if (error) throw InputError(directory + ": cannot be listed (" + error.message() + ")");
  std::sort(files.begin(), files.end());
  if (files.empty()) throw InputError(directory + ": no .obj, .stl or .ply file in it");
  std::vector<ObjectPtr> library;
  for (const fs::path& file : files) {
    library.push_back(load_solid(file.string(), unit, "--objects-unit").object);
  }
  return library;
}

void check_readings(const DepthImage& depth, const std::string& file) {
  const auto valid = [](float z) { return std::isfinite(z) && z > 0.0F; };
  if (std::none_of(depth.pixels.begin(), depth.pixels.end(), valid)) {
    throw InputError(file + ": no pixel has a depth reading; is it the right image?");
  }
}

nlohmann::json matrix(const Pose& pose) {
  nlohmann::json rows = nlohmann::json::array();
  for (int r = 0; r < 4; ++r) {
    rows.push_back({pose.matrix()(r, 0), pose.matrix()(r, 1), pose.matrix()(r, 2), pose.matrix()(r, 3)});
  }
  return rows;
}

nlohmann::json number_or_null(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

std::string object_file(std::size_t index) { return "objects/" + std::to_string(index) + ".obj"; }

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

}  // namespace

ObjectAndOffset load_query(const std::string& name_or_file, double unit) {
  const auto& names = block_names();
  if (std::find(names.begin(), names.end(), name_or_file) != names.end()) return {make_block(name_or_file), {0, 0, 0}};
  std::error_code error;
  if (!fs::exists(name_or_file, error)) {
    std::string known;
    for (const std::string& name : names) known += (known.empty() ? "" : ", ") + name;
    throw InputError("--query " + name_or_file + ": neither a mesh file nor a block (" + known + ")");
  }
  return load_solid(name_or_file, unit, "--query-unit");
}

void check_inputs_survive(const PlaceArguments& arguments, const std::string& directory) {
  for (const std::string& input : {arguments.depth, arguments.cloud, arguments.camera, arguments.mask, arguments.query,
                                   arguments.objects, arguments.model}) {
    for (const char* output : {"placements.json", "segmentation.png", "query.obj", "scene.xml", "scene.glb",
                               "report.html", "objects"}) {
      std::error_code error;
      if (input.empty() || !fs::equivalent(input, fs::path(directory) / output, error)) continue;
      throw InputError(input + ": --out " + directory + " would write over it; choose another folder");
    }
  }
}

PlaceInputs load_inputs(const PlaceArguments& arguments) {
  PlaceInputs inputs;
  inputs.camera = read_camera(arguments.camera);
  const std::string& image = arguments.cloud.empty() ? arguments.depth : arguments.cloud;
  inputs.depth = arguments.cloud.empty() ? read_depth(arguments.depth, inputs.camera)
                                         : read_cloud_as_depth(arguments.cloud, inputs.camera);
  check_readings(inputs.depth, image);
  if (!arguments.mask.empty()) inputs.mask = read_labels(arguments.mask, inputs.camera);
  const ObjectAndOffset query = load_query(arguments.query, arguments.query_unit);
  inputs.query = query.object;
  inputs.query_origin = query.origin;
  if (!arguments.objects.empty()) inputs.library = load_library(arguments.objects, arguments.objects_unit);
  return inputs;
}

namespace {

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

}  // namespace

PlaceResult run_placement(const PlaceInputs& inputs, const PlaceArguments& arguments) {
  PlaceResult result;
  SceneRecoveryOptions recovery;
  recovery.library = inputs.library;
  recovery.mask = inputs.mask;
  recovery.physics = arguments.placement.physics;
  recovery.threads = arguments.placement.threads;
  const PlacementModel model = PlacementModel::load(arguments.model.empty() ? default_model_path() : arguments.model);
  result.recovered = recover_scene(inputs.depth, inputs.camera, recovery);
  const auto recovered_ms = [&](const char* step) {
    const auto found = result.recovered.timing_ms.find(step);
    return found == result.recovered.timing_ms.end() ? 0.0 : found->second;
  };
  result.timing_ms = {{"segment", recovered_ms("segment")}, {"recover", recovered_ms("recover")}};
  if (!result.recovered.table) {
    for (const char* step : {"sdf", "sample", "settle"}) result.timing_ms.emplace_back(step, 0.0);
    return result;
  }

  Stopwatch watch;
  const Scene scene = with_distance_fields(result.recovered.scene, {}, arguments.placement.threads);
  const ObjectPtr query = with_distance_field(inputs.query, {}, arguments.placement.threads);
  result.timing_ms.emplace_back("sdf", watch.lap_ms());
  SamplerOptions sampler;
  sampler.steps = arguments.placement.steps;
  sampler.threads = arguments.placement.threads;
  const std::vector<Pose> candidates =
      sample_interruptibly(model, placement_problems(scene, query, arguments.placement), sampler);
  result.timing_ms.emplace_back("sample", watch.lap_ms());
  if (interrupted()) throw Interrupted("interrupted");
  result.placements = check_placements(scene, query, candidates, arguments.placement);
  result.timing_ms.emplace_back("settle", watch.lap_ms());
  return result;
}

std::string placements_json(const PlaceInputs& inputs, const PlaceArguments& arguments, const PlaceResult& result) {
  nlohmann::ordered_json json;
  json["format"] = "dofusion-placements";
  json["version"] = 1;
  json["seed"] = arguments.placement.seed;
  const bool table = result.recovered.table.has_value();
  json["status"] = !table ? "no_table" : result.recovered.objects.empty() ? "no_object" : "ok";
  const Pose T_world_camera = table ? result.recovered.table->T_world_camera : Pose::Identity();
  json["T_world_camera"] = table ? matrix(T_world_camera) : nlohmann::json();
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
  const Eigen::Vector3d& origin = inputs.query_origin;
  json["query"] = {{"name", inputs.query->name},
                   {"mesh", "query.obj"},
                   {"origin_in_file", {origin.x(), origin.y(), origin.z()}}};
  json["placements"] = nlohmann::json::array();
  for (std::size_t i = 0; i < result.placements.size(); ++i) {
    const Placement& placement = result.placements[i];
    json["placements"].push_back(
        {{"rank", i + 1},
         {"T_world_query", matrix(placement.T_world_query)},
         {"T_camera_query", matrix(T_world_camera.inverse() * placement.T_world_query)},
         {"stable", placement.stable},
         {"status", to_string(placement.status)},
         {"robustness", placement.robustness ? nlohmann::json(*placement.robustness) : nlohmann::json()},
         {"translational_displacement_pct", number_or_null(placement.displacement.translation_pct)},
         {"rotational_displacement_deg", number_or_null(placement.displacement.rotation_deg)},
         {"penetration_m", placement.penetration}});
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
    write_obj(result.recovered.objects[i].object->mesh, directory + "/" + object_file(i));
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
