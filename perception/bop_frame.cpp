#include "perception/bop_frame.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <nlohmann/json.hpp>

#include "perception/bop_dataset.h"
#include "perception/png.h"
#include "stability/files.h"

namespace dofusion {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kMetre = 0.001;  // in millimetres

std::vector<std::string> splits_with(const fs::path& dataset, const std::string& scene) {
  std::vector<std::string> splits;
  std::error_code error;
  for (fs::directory_iterator entry(dataset, error), end; !error && entry != end; entry.increment(error)) {
    if (fs::is_directory(entry->path() / scene, error)) splits.push_back(entry->path().filename().string());
    error.clear();
  }
  std::sort(splits.begin(), splits.end());
  return splits;
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

fs::path scene_folder(const fs::path& dataset, const std::string& split, int scene) {
  const std::string name = bop_scene_name(scene);
  std::error_code error;
  if (!fs::is_directory(dataset, error)) throw InputError(dataset.string() + ": --bop needs the folder of a dataset");
  if (!split.empty()) {
    if (fs::is_directory(dataset / split / name, error)) return dataset / split / name;
    const std::vector<std::string> splits = splits_with(dataset, name);
    throw InputError((dataset / split / name).string() + ": no such scene" +
                     (splits.empty() ? "" : "; --split may be " + joined(splits)));
  }
  const std::vector<std::string> splits = splits_with(dataset, name);
  if (splits.empty()) throw InputError(dataset.string() + ": no split has a scene " + name);
  if (splits.size() > 1)
    throw InputError(dataset.string() + ": scene " + name + " is in several splits; give --split, one of " +
                     joined(splits));
  return dataset / splits.front() / name;
}

// `count` finite numbers under `key`.
std::vector<double> numbers(const json& camera, const std::string& key, std::size_t count, const std::string& place) {
  std::vector<double> values;
  if (camera.contains(key) && camera[key].is_array()) {
    for (const json& value : camera[key]) {
      if (value.is_number() && std::isfinite(value.get<double>())) values.push_back(value.get<double>());
    }
  }
  if (values.size() != count)
    throw InputError(place + ": " + key + " must be " + std::to_string(count) + " numbers; is it a BOP dataset?");
  return values;
}

Pose world_pose(const json& camera, const std::string& place) {
  const std::vector<double> r = numbers(camera, "cam_R_w2c", 9, place), t = numbers(camera, "cam_t_w2c", 3, place);
  Eigen::Matrix3d R;
  R << r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8];
  if (!(R * R.transpose()).isApprox(Eigen::Matrix3d::Identity(), 1e-3) || R.determinant() < 0.0)
    throw InputError(place + ": cam_R_w2c is not a rotation");
  const Pose T_camera_world = make_pose(Eigen::Quaterniond(R).normalized().toRotationMatrix(),
                                        kMetre * Eigen::Vector3d(t[0], t[1], t[2]));
  return T_camera_world.inverse();
}

}  // namespace

BopFrame find_bop_frame(const fs::path& dataset, const std::string& split, int scene, int image) {
  const fs::path folder = scene_folder(dataset, split, scene);
  const fs::path cameras = folder / "scene_camera.json";
  const json file = json::parse(read_file(cameras), nullptr, /*allow_exceptions=*/false);
  if (!file.is_object()) throw InputError(cameras.string() + ": not valid JSON; expected BOP's scene_camera.json");
  const std::string key = std::to_string(image), place = cameras.string() + ", image " + key;
  if (!file.contains(key) || !file[key].is_object())
    throw InputError(cameras.string() + ": no image " + key + "; the scene has " + std::to_string(file.size()));
  const json& camera = file[key];
  const std::vector<double> K = numbers(camera, "cam_K", 9, place);
  BopFrame frame;
  frame.camera.fx = K[0], frame.camera.cx = K[2], frame.camera.fy = K[4], frame.camera.cy = K[5];
  frame.camera.depth_scale =
      camera.contains("depth_scale") && camera["depth_scale"].is_number() ? camera["depth_scale"].get<double>() : 0.0;
  for (const double positive : {frame.camera.fx, frame.camera.fy, frame.camera.depth_scale}) {
    if (!(positive > 0.0)) throw InputError(place + ": cam_K and depth_scale need positive numbers");
  }
  frame.depth = (folder / "depth" / (bop_scene_name(image) + ".png")).string();
  const PngHeader header = check_png(read_file(frame.depth), frame.depth);
  frame.camera.width = header.width;
  frame.camera.height = header.height;
  if (camera.contains("cam_R_w2c")) frame.T_world_camera = world_pose(camera, place);
  return frame;
}

}  // namespace dofusion
