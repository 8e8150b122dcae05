#include "perception/camera.h"

#include <cmath>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

using nlohmann::json;

constexpr double kMostPixels = 1e8;  // of an image: a wrong size shall not fill the memory

double number_field(const json& object, const char* name, const std::string& path) {
  const auto field = object.find(name);
  if (field == object.end())
    throw InputError(path + ": the field \"" + name + "\" is missing; " +
                     "a camera has fx, fy, cx, cy, width, height, depth_scale");
  if (!field->is_number()) throw InputError(path + ": the field \"" + name + "\" must be a number");
  const double value = field->get<double>();
  if (!std::isfinite(value)) throw InputError(path + ": the field \"" + name + "\" must be finite");
  return value;
}

double positive_field(const json& object, const char* name, const std::string& path) {
  const double value = number_field(object, name, path);
  if (value <= 0.0) throw InputError(path + ": the field \"" + name + "\" must be positive, not " + json(value).dump());
  return value;
}

int size_field(const json& object, const char* name, const std::string& path) {
  constexpr double kLargest = 65536.0;
  const double value = positive_field(object, name, path);
  if (value != std::floor(value) || value > kLargest)
    throw InputError(path + ": the field \"" + name + "\" must be a whole number of pixels, not " + json(value).dump());
  return static_cast<int>(value);
}

}  // namespace

Camera camera_of_fovy(double fovy, int width, int height) {
  if (!(fovy > 0.0 && fovy < M_PI) || width <= 0 || height <= 0)
    throw std::invalid_argument("no camera has a field of view of " + std::to_string(fovy) + " radians and " +
                                std::to_string(width) + "x" + std::to_string(height) + " pixels");
  Camera camera;
  camera.fx = camera.fy = 0.5 * height / std::tan(0.5 * fovy);
  camera.cx = 0.5 * (width - 1);  // pixel centres are at integers
  camera.cy = 0.5 * (height - 1);
  camera.width = width;
  camera.height = height;
  return camera;
}

Pose look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d view = target - eye;
  const Eigen::Vector3d right = view.cross(Eigen::Vector3d::UnitZ());
  // `right` vanishes if the points coincide or the view is along z; an image's up is then undefined.
  if (!(right.norm() > 1e-9 * view.norm()))
    throw std::invalid_argument("look_at: the eye and the target must not coincide or lie above one another");
  Eigen::Matrix3d R;
  R.col(0) = right.normalized();
  R.col(2) = view.normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  return make_pose(R, eye);
}

Camera read_camera(const std::string& path) {
  const json file = json::parse(read_file(path), nullptr, /*allow_exceptions=*/false);
  if (file.is_discarded()) throw InputError(path + ": not valid JSON; expected a BOP camera.json");
  if (!file.is_object()) throw InputError(path + ": expected a JSON object with the camera's fields");
  Camera camera;
  camera.fx = positive_field(file, "fx", path);
  camera.fy = positive_field(file, "fy", path);
  camera.cx = number_field(file, "cx", path);
  camera.cy = number_field(file, "cy", path);
  camera.width = size_field(file, "width", path);
  camera.height = size_field(file, "height", path);
  camera.depth_scale = positive_field(file, "depth_scale", path);
  if (static_cast<double>(camera.width) * camera.height > kMostPixels)
    throw InputError(path + ": an image of " + std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                     " pixels is more than the 100 million that are read");
  return camera;
}

void write_camera(const Camera& camera, const std::string& path) {
  const nlohmann::ordered_json file = {{"cx", camera.cx},      {"cy", camera.cy}, {"depth_scale", camera.depth_scale},
                                       {"fx", camera.fx},      {"fy", camera.fy}, {"height", camera.height},
                                       {"width", camera.width}};
  write_file(path, file.dump(2) + "\n");
}

}  // namespace dofusion
