#include "apps/place_inputs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "apps/program.h"
#include "perception/bop_frame.h"
#include "perception/cloud_io.h"
#include "perception/depth_io.h"
#include "stability/convex_parts.h"
#include "stability/files.h"
#include "stability/mesh_io.h"
#include "stability/shapes.h"

namespace dofusion {
namespace fs = std::filesystem;
namespace {

constexpr double kBopModelsUnit = 0.001;  // metres: BOP's meshes are in millimetres

// The solid of a mesh file; `unit_option` is the argument that says its unit.
ObjectAndOffset load_solid(const std::string& file, double unit, const std::string& unit_option) {
  ObjectAndOffset solid;
  try {
    const MendedMesh mended = read_mended_mesh(file, unit, kMostSolidTriangles);
    if (mended.holes > 0) note(mending_note(file, mended));
    solid = make_object(fs::path(file).stem().string(), mended.mesh);
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

// Images with their cameras' poses in one frame, where that is known.
struct LoadedView {
  std::string file;
  View view;
  bool posed = false;
};

LoadedView load_view(const std::string& file, const Camera& camera, const std::optional<Pose>& T_given_camera) {
  LoadedView loaded{file, {read_depth(file, camera), camera, T_given_camera.value_or(Pose::Identity()), {}},
                    T_given_camera.has_value()};
  check_readings(loaded.view.depth, file);
  return loaded;
}

std::vector<LoadedView> load_bop_views(const PlaceArguments& arguments) {
  std::vector<LoadedView> views;
  for (const int image : arguments.images) {
    const BopFrame frame = find_bop_frame(arguments.bop, arguments.split, arguments.scene, image);
    if (arguments.images.size() > 1 && !frame.T_world_camera)
      throw InputError(frame.depth + ": scene_camera.json has no cam_R_w2c for it, without which several images cannot "
                                     "be joined; give one --image");
    views.push_back(load_view(frame.depth, frame.camera, frame.T_world_camera));
  }
  return views;
}

std::vector<LoadedView> load_views(const PlaceArguments& arguments) {
  if (!arguments.bop.empty()) return load_bop_views(arguments);
  std::vector<LoadedView> views;
  for (const PlaceView& view : arguments.views) {
    views.push_back(load_view(view.depth, read_camera(view.camera), read_pose(view.pose, {"T_world_camera"}).pose));
  }
  if (!views.empty()) return views;
  const Camera camera = read_camera(arguments.camera);
  if (arguments.cloud.empty()) return {load_view(arguments.depth, camera, std::nullopt)};
  LoadedView loaded{arguments.cloud, {read_cloud_as_depth(arguments.cloud, camera), camera, Pose::Identity(), {}}, false};
  check_readings(loaded.view.depth, arguments.cloud);
  return {loaded};
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
  std::vector<std::string> inputs = {arguments.depth, arguments.cloud, arguments.camera, arguments.mask,
                                     arguments.query, arguments.objects, arguments.model, arguments.refine};
  for (const PlaceView& view : arguments.views) inputs.insert(inputs.end(), {view.depth, view.camera, view.pose});
  for (const std::string& input : inputs) {
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
  std::vector<LoadedView> views = load_views(arguments);
  inputs.source = views.front().file;
  inputs.camera = views.front().view.camera;
  inputs.depth = std::move(views.front().view.depth);
  if (views.front().posed) inputs.T_given_camera = views.front().view.T_world_camera;
  for (std::size_t i = 1; i < views.size(); ++i) inputs.more_views.push_back(std::move(views[i].view));
  if (!arguments.mask.empty()) inputs.mask = read_labels(arguments.mask, inputs.camera);
  const ObjectAndOffset query = load_query(arguments.query, arguments.query_unit);
  inputs.query = query.object;
  inputs.query_origin = query.origin;
  if (!arguments.refine.empty()) inputs.estimate = read_pose(arguments.refine, {"T_camera_query", "T_world_query"});
  if (!arguments.objects.empty()) inputs.library = load_library(arguments.objects, arguments.objects_unit);
  if (arguments.bop_models) inputs.library = load_library((fs::path(arguments.bop) / "models").string(), kBopModelsUnit);
  return inputs;
}

}  // namespace dofusion
