#include "perception/bop_dataset.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "perception/depth_io.h"
#include "stability/files.h"

namespace dofusion {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr double kMillimetres = 1000.0;  // in a metre
constexpr std::uint8_t kMasked = 255;

std::string number_name(int number) {
  char text[16];
  std::snprintf(text, sizeof text, "%06d", number);
  return text;
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(folder.string() + ": cannot be created: " + error.message());
}

std::string to_ply_mm(const TriangleMesh& mesh) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(mesh.vertices.size()) +
                     "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                     std::to_string(mesh.triangles.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  char line[96];
  for (const Eigen::Vector3d& v : mesh.vertices) {
    const Eigen::Vector3d mm = kMillimetres * v;
    std::snprintf(line, sizeof line, "%.9g %.9g %.9g\n", mm.x(), mm.y(), mm.z());
    text += line;
  }
  for (const Eigen::Vector3i& t : mesh.triangles) {
    std::snprintf(line, sizeof line, "3 %d %d %d\n", t[0], t[1], t[2]);
    text += line;
  }
  return text;
}

Json model_info(const Object& object) {
  const BoundingBox box = bounding_box(object.mesh);
  const Eigen::Vector3d min = kMillimetres * box.min, size = kMillimetres * (box.max - box.min);
  return {{"diameter", kMillimetres * object.diameter},
          {"min_x", min.x()},
          {"min_y", min.y()},
          {"min_z", min.z()},
          {"size_x", size.x()},
          {"size_y", size.y()},
          {"size_z", size.z()},
          {"name", object.name}};
}

Json rotation_json(const Pose& pose) {
  Json values = Json::array();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) values.push_back(pose.linear()(row, column));
  return values;
}

Json translation_mm_json(const Pose& pose) {
  const Eigen::Vector3d t = kMillimetres * pose.translation();
  return {t.x(), t.y(), t.z()};
}

// Bounding box of pixels as BOP has it: x, y, width, height; -1 four times where there is none.
struct PixelBox {
  int u0 = 0, v0 = 0, u1 = -1, v1 = -1;  // inclusive
  void add(int u, int v) {
    if (u1 < u0) {
      *this = {u, v, u, v};
      return;
    }
    u0 = std::min(u0, u), u1 = std::max(u1, u);
    v0 = std::min(v0, v), v1 = std::max(v1, v);
  }
  Json json() const { return u1 < u0 ? Json{-1, -1, -1, -1} : Json{u0, v0, u1 - u0 + 1, v1 - v0 + 1}; }
};

// The part of the image plane, up to one image beyond the image, in which an object can appear.
PixelBox projected_box(const Object& object, const Pose& T_camera_object, const Camera& camera) {
  PixelBox box;
  for (const Eigen::Vector3d& vertex : object.mesh.vertices) {
    const Eigen::Vector3d p = T_camera_object * vertex;
    if (p.z() <= 0.0) return {-camera.width, -camera.height, 2 * camera.width - 1, 2 * camera.height - 1};
    const Eigen::Vector2d pixel = project(camera, p);
    box.add(static_cast<int>(std::floor(std::clamp(pixel.x(), -1.0 * camera.width, 2.0 * camera.width - 1))),
            static_cast<int>(std::floor(std::clamp(pixel.y(), -1.0 * camera.height, 2.0 * camera.height - 1))));
  }
  ++box.u1, ++box.v1;
  return box;
}

ScannerOptions without_table() {
  ScannerOptions options;
  options.table = false;
  return options;
}

}  // namespace

std::string bop_scene_name(int scene) { return number_name(scene); }

void write_bop_models(const std::vector<ObjectPtr>& models, const Camera& camera, const fs::path& dataset) {
  make_folder(dataset / "models");
  Json info = Json::object();
  for (std::size_t i = 0; i < models.size(); ++i) {
    const int id = static_cast<int>(i) + 1;
    info[std::to_string(id)] = model_info(*models[i]);
    write_file(dataset / "models" / ("obj_" + number_name(id) + ".ply"), to_ply_mm(models[i]->mesh));
  }
  write_file(dataset / "models" / "models_info.json", info.dump(1) + "\n");
  write_camera(camera, (dataset / "camera.json").string());
}

struct BopSceneWriter::Impl {
  Scene scene;
  std::vector<int> model_ids;
  Camera camera;
  fs::path folder;
  std::vector<Scanner> alone;  // per object, without anything that could hide it
  int images = 0;
  Json cameras = Json::object(), truth = Json::object(), info = Json::object();

  std::string file(const char* kind, const std::string& name) const {
    return (folder / kind / (name + ".png")).string();
  }
  void write_masks(int object, const SyntheticView& view, const std::string& image, Json& image_info);
};

BopSceneWriter::BopSceneWriter(const Scene& scene, const std::vector<int>& model_ids, const Camera& camera,
                               const fs::path& folder)
    : impl_(std::make_unique<Impl>()) {
  if (model_ids.size() != scene.objects.size())
    throw std::invalid_argument(std::to_string(model_ids.size()) + " model ids for " +
                                std::to_string(scene.objects.size()) + " objects");
  impl_->scene = scene;
  impl_->model_ids = model_ids;
  impl_->camera = camera;
  impl_->folder = folder;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    impl_->alone.emplace_back(std::vector<ObjectPtr>{scene.objects[i]}, without_table());
    impl_->alone.back().set_poses({scene.T_world_object[i]});
  }
  for (const char* kind : {"rgb", "depth", "mask", "mask_visib"}) make_folder(folder / kind);
}

BopSceneWriter::~BopSceneWriter() = default;

void BopSceneWriter::add(const SyntheticView& view, const ColourImage& rgb) {
  Impl& impl = *impl_;
  const std::string image = number_name(impl.images), key = std::to_string(impl.images);
  write_depth(view.depth, impl.camera, impl.file("depth", image));
  write_picture(rgb, impl.file("rgb", image));

  const Camera& c = impl.camera;
  const Pose T_camera_world = view.T_world_camera.inverse();
  impl.cameras[key] = {{"cam_K", {c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0}},
                       {"depth_scale", c.depth_scale},
                       {"cam_R_w2c", rotation_json(T_camera_world)},
                       {"cam_t_w2c", translation_mm_json(T_camera_world)}};
  Json truth = Json::array(), info = Json::array();
  for (std::size_t i = 0; i < impl.scene.objects.size(); ++i) {
    const Pose T_camera_object = T_camera_world * impl.scene.T_world_object[i];
    truth.push_back({{"cam_R_m2c", rotation_json(T_camera_object)},
                     {"cam_t_m2c", translation_mm_json(T_camera_object)},
                     {"obj_id", impl.model_ids[i]}});
    impl.write_masks(static_cast<int>(i), view, image, info);
  }
  impl.truth[key] = std::move(truth);
  impl.info[key] = std::move(info);
  ++impl.images;
}

// As in BOP, silhouette and its box and count go on beyond the image (up to one image), masks end with it.
void BopSceneWriter::Impl::write_masks(int object, const SyntheticView& view, const std::string& image,
                                       Json& image_info) {
  const auto i = static_cast<std::size_t>(object);
  const Pose T_camera_object = view.T_world_camera.inverse() * scene.T_world_object[i];
  const PixelBox window = projected_box(*scene.objects[i], T_camera_object, camera);
  const Scan silhouette =
      alone[i].render_window(camera, view.T_world_camera, window.u0, window.v0, window.u1 + 1, window.v1 + 1);
  LabelImage mask(camera.width, camera.height), visible(camera.width, camera.height);
  PixelBox box, visible_box;
  int all = 0, valid = 0, seen = 0;
  for (int row = 0; row < silhouette.labels.height; ++row)
    for (int column = 0; column < silhouette.labels.width; ++column) {
      if (silhouette.labels.at(row, column) == kLabelNothing) continue;
      const int u = window.u0 + column, v = window.v0 + row;
      ++all;
      box.add(u, v);
      if (!mask.contains(v, u)) continue;
      mask.at(v, u) = kMasked;
      valid += view.depth.at(v, u) > 0.0f;
    }
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      if (view.truth.labels.at(v, u) != kLabelFirstObject + object) continue;
      visible.at(v, u) = kMasked;
      visible_box.add(u, v);
      ++seen;
    }
  write_labels(mask, file("mask", image + "_" + number_name(object)));
  write_labels(visible, file("mask_visib", image + "_" + number_name(object)));
  image_info.push_back({{"bbox_obj", box.json()},
                        {"bbox_visib", visible_box.json()},
                        {"px_count_all", all},
                        {"px_count_valid", valid},
                        {"px_count_visib", seen},
                        {"visib_fract", all > 0 ? static_cast<double>(seen) / all : 0.0}});
}

void BopSceneWriter::finish() {
  write_file(impl_->folder / "scene_camera.json", impl_->cameras.dump(1) + "\n");
  write_file(impl_->folder / "scene_gt.json", impl_->truth.dump(1) + "\n");
  write_file(impl_->folder / "scene_gt_info.json", impl_->info.dump(1) + "\n");
}

}  // namespace dofusion
