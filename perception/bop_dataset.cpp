#include "perception/bop_dataset.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "perception/depth_io.h"
#include "perception/pcl_conversions.h"
#include "stability/files.h"

namespace dofusion {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr double kMillimetres = 1000.0;  // in a metre
constexpr std::uint8_t kMasked = 255;
constexpr char kRecords[] = "records";              // folder of what the JSON files will say of each image
constexpr char kLastFile[] = "scene_gt_info.json";  // of a scene
constexpr char kInside[] = "inside";                // pixels of the silhouette in the image; in the records alone

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

Json camera_json(const CalibratedCamera& calibrated) {
  const Camera& c = calibrated.camera;
  const Pose T_camera_world = calibrated.T_world_camera.inverse();
  return {{"cam_K", {c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0}},
          {"depth_scale", c.depth_scale},
          {"cam_R_w2c", rotation_json(T_camera_world)},
          {"cam_t_w2c", translation_mm_json(T_camera_world)}};
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
  // Round shapes reach a little beyond their meshes.
  const int more = 1 + (box.u1 - box.u0 + box.v1 - box.v0) / 200;
  box.u0 = std::max(box.u0 - more, -camera.width), box.u1 = std::min(box.u1 + more, 2 * camera.width - 1);
  box.v0 = std::max(box.v0 - more, -camera.height), box.v1 = std::min(box.v1 + more, 2 * camera.height - 1);
  return box;
}

// Per object, 255 where it is what the camera sees.
std::vector<LabelImage> visible_parts(const LabelImage& labels, std::size_t objects) {
  std::vector<LabelImage> parts(objects, LabelImage(labels.width, labels.height));
  for (std::size_t p = 0; p < labels.pixels.size(); ++p) {
    const std::size_t object = labels.pixels[p] - std::size_t{kLabelFirstObject};
    if (object < objects) parts[object].pixels[p] = kMasked;
  }
  return parts;
}

}  // namespace

std::string bop_scene_name(int scene) { return number_name(scene); }

struct BopSceneWriter::Impl {
  Scene scene;
  std::vector<int> model_ids;
  fs::path folder;
  bool clouds = false;
  const SceneScanner* scanner = nullptr;

  std::string file(const char* kind, const std::string& name) const {
    return (folder / kind / (name + ".png")).string();
  }
  Json write_masks(int object, const Camera& camera, const SyntheticView& view, const LabelImage& visible,
                   const std::string& image);
};

BopSceneWriter::BopSceneWriter(const Scene& scene, const SceneScanner& scanner, const std::vector<int>& model_ids,
                               const fs::path& folder, bool clouds)
    : impl_(std::make_unique<Impl>()) {
  if (model_ids.size() != scene.objects.size())
    throw std::invalid_argument(std::to_string(model_ids.size()) + " model ids for " +
                                std::to_string(scene.objects.size()) + " objects");
  impl_->scene = scene;
  impl_->scanner = &scanner;
  impl_->model_ids = model_ids;
  impl_->folder = folder;
  impl_->clouds = clouds;
  for (const char* kind : {"rgb", "depth", "mask", "mask_visib", kRecords}) make_folder(folder / kind);
  if (clouds) make_folder(folder / "pcd");
}

BopSceneWriter::~BopSceneWriter() = default;

void BopSceneWriter::add(int image, const Camera& c, const SyntheticView& view, const ColourImage& rgb) {
  Impl& impl = *impl_;
  const std::string name = number_name(image);
  write_depth(view.depth, c, impl.file("depth", name));
  write_picture(rgb, impl.file("rgb", name));
  if (impl.clouds) write_cloud(to_cloud(view.depth, c), (impl.folder / "pcd" / (name + ".pcd")).string());

  const Pose T_camera_world = view.T_world_camera.inverse();
  Json record;
  record["camera"] = camera_json(view.believed.value_or(CalibratedCamera{c, view.T_world_camera}));
  const std::size_t objects = impl.scene.objects.size();
  std::vector<LabelImage> visible = visible_parts(view.truth.labels, objects);
  record["truth"] = Json::array();
  record["info"] = Json::array();
  for (std::size_t i = 0; i < objects; ++i) {
    const Pose T_camera_object = T_camera_world * impl.scene.T_world_object[i];
    record["truth"].push_back({{"cam_R_m2c", rotation_json(T_camera_object)},
                               {"cam_t_m2c", translation_mm_json(T_camera_object)},
                               {"obj_id", impl.model_ids[i]}});
    record["info"].push_back(impl.write_masks(static_cast<int>(i), c, view, visible[i], name));
  }
  write_file(impl.folder / kRecords / (name + ".json"), record.dump());
}

// As in BOP, silhouette and its box and count go on beyond the image (up to one image), masks end with it.
Json BopSceneWriter::Impl::write_masks(int object, const Camera& camera, const SyntheticView& view,
                                       const LabelImage& visible, const std::string& image) {
  const auto i = static_cast<std::size_t>(object);
  const Pose T_camera_object = view.T_world_camera.inverse() * scene.T_world_object[i];
  const PixelBox window = projected_box(*scene.objects[i], T_camera_object, camera);
  const LabelImage silhouette =
      scanner->silhouette(object, camera, view.T_world_camera, {window.u0, window.v0, window.u1 + 1, window.v1 + 1});
  LabelImage mask(camera.width, camera.height);
  PixelBox box, visible_box;
  int all = 0, valid = 0, seen = 0, inside = 0;
  for (int row = 0; row < silhouette.height; ++row)
    for (int column = 0; column < silhouette.width; ++column) {
      const int u = window.u0 + column, v = window.v0 + row;
      const bool in_image = mask.contains(v, u), is_seen = in_image && visible.at(v, u) != 0;
      // Rays that graze the outline may hit in one scan and miss in the other: what is seen is part of the silhouette.
      if (silhouette.at(row, column) == kLabelNothing && !is_seen) continue;
      ++all;
      box.add(u, v);
      if (!in_image) continue;
      ++inside;
      mask.at(v, u) = kMasked;
      valid += view.depth.at(v, u) > 0.0f;
      if (!is_seen) continue;
      visible_box.add(u, v);
      ++seen;
    }
  write_labels(mask, file("mask", image + "_" + number_name(object)));
  write_labels(visible, file("mask_visib", image + "_" + number_name(object)));
  return {{"bbox_obj", box.json()}, {"bbox_visib", visible_box.json()},
          {"px_count_all", all},    {"px_count_valid", valid},
          {"px_count_visib", seen}, {"visib_fract", all > 0 ? static_cast<double>(seen) / all : 0.0},
          {kInside, inside}};
}

namespace {

void write_scene_files(const fs::path& folder, int images, const Scene& scene) {
  Json cameras = Json::object(), truth = Json::object(), info = Json::object();
  std::vector<bool> inside(scene.objects.size(), false);  // of any image
  for (int image = 0; image < images; ++image) {
    const fs::path file = folder / kRecords / (number_name(image) + ".json");
    Json record = Json::parse(read_file(file), nullptr, false);
    if (record.is_discarded() || record.value("info", Json::array()).size() != scene.objects.size())
      throw InputError(file.string() + ": is damaged; delete it and give the same command again");
    const std::string key = std::to_string(image);
    cameras[key] = std::move(record["camera"]);
    truth[key] = std::move(record["truth"]);
    for (std::size_t i = 0; i < inside.size(); ++i) {
      Json& object = record["info"][i];
      if (object[kInside].get<int>() > 0) inside[i] = true;
      object.erase(kInside);
    }
    info[key] = std::move(record["info"]);
  }
  const auto unseen = std::find(inside.begin(), inside.end(), false);
  if (unseen != inside.end()) {
    const auto i = static_cast<std::size_t>(unseen - inside.begin());
    throw UnusableScene("object " + std::to_string(i) + " (" + scene.objects[i]->name + ") lies outside " +
                        (images == 1 ? "the image" : "all " + std::to_string(images) + " images") +
                        "; look from farther away or with more cameras");
  }
  write_file(folder / "scene_camera.json", cameras.dump(1) + "\n");
  write_file(folder / "scene_gt.json", truth.dump(1) + "\n");
  write_file(folder / kLastFile, info.dump(1) + "\n");
}

}  // namespace

bool has_bop_image(const fs::path& folder, int image) {
  std::error_code error;
  return fs::exists(folder / kLastFile, error) || fs::exists(folder / kRecords / (number_name(image) + ".json"), error);
}

void finish_bop_scene(const fs::path& folder, int images, const Scene& scene) {
  std::error_code error;
  if (!fs::exists(folder / kLastFile, error)) write_scene_files(folder, images, scene);
  fs::remove_all(folder / kRecords, error);
  if (error) throw InputError((folder / kRecords).string() + ": cannot be removed: " + error.message());
}

}  // namespace dofusion
