#include "apps/scan_scenes.h"

#include <array>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <optional>

#include "apps/program.h"
#include "perception/bop_dataset.h"
#include "perception/image.h"
#include "stability/dataset_journal.h"
#include "stability/parallel_for.h"

namespace dofusion {
namespace {

constexpr std::size_t kMostObjects = 255 - kLabelFirstObject;

class Fnv1a {
 public:
  void add(const void* bytes, std::size_t size) {
    const auto* at = static_cast<const unsigned char*>(bytes);
    for (std::size_t i = 0; i < size; ++i) hash_ = (hash_ ^ at[i]) * 0x100000001B3u;
  }
  std::string hex() const {
    char text[17];
    std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash_));
    return text;
  }

 private:
  std::uint64_t hash_ = 0xCBF29CE484222325u;
};

void add_pose(const Pose& pose, Fnv1a& hash) { hash.add(pose.matrix().data(), sizeof(double) * 16); }

void add_mesh(const TriangleMesh& mesh, Fnv1a& hash) {
  for (const Eigen::Vector3d& v : mesh.vertices) hash.add(v.data(), sizeof(double) * 3);
  for (const Eigen::Vector3i& t : mesh.triangles) hash.add(t.data(), sizeof(int) * 3);
}

void add_geoms(const GeomScene& scene, Fnv1a& hash) {
  for (const Geom& geom : scene.geoms) {
    hash.add(&geom.type, sizeof geom.type);
    hash.add(geom.size.data(), sizeof(double) * 3);
    hash.add(&geom.body, sizeof geom.body);
    hash.add(geom.rgba.data(), sizeof geom.rgba);
    add_pose(geom.T_body_geom, hash);
    if (geom.mesh) add_mesh(*geom.mesh, hash);
    if (geom.height_field) add_mesh(height_field_mesh(*geom.height_field), hash);
  }
  for (const Pose& pose : scene.T_world_body) add_pose(pose, hash);
}

}  // namespace

SceneDataset generate_scenes(const GenerationOptions& options, std::int64_t count, int threads,
                             const std::filesystem::path& journal_file) {
  SceneJournal journal(journal_file, to_json(options));
  std::vector<std::unique_ptr<SceneGenerator>> generators(static_cast<std::size_t>(threads));
  generators.front() = std::make_unique<SceneGenerator>(options);
  SceneDataset dataset;
  dataset.shapes = generators.front()->shapes();
  dataset.scenes.resize(static_cast<std::size_t>(count));
  journal.for_each([&](const JournalEntry& entry) {
    if (entry.scene.index < count) dataset.scenes[static_cast<std::size_t>(entry.scene.index)] = entry.scene;
  });
  std::vector<std::int64_t> missing;
  for (std::int64_t i = 0; i < count; ++i) {
    if (dataset.scenes[static_cast<std::size_t>(i)].objects.empty()) missing.push_back(i);
  }
  if (missing.empty()) return dataset;
  Progress progress("scenes", count, count - static_cast<std::int64_t>(missing.size()));
  std::mutex mutex;  // of journal and count
  std::int64_t done = count - static_cast<std::int64_t>(missing.size());
  parallel_for(static_cast<std::int64_t>(missing.size()), threads, [&](std::int64_t k, int thread) {
    auto& generator = generators[static_cast<std::size_t>(thread)];
    if (!generator) generator = std::make_unique<SceneGenerator>(options);
    JournalEntry entry;
    std::optional<SceneRecord> scene = generator->generate(missing[static_cast<std::size_t>(k)], interrupted);
    if (!scene) throw Interrupted("interrupted");
    entry.scene = std::move(*scene);
    const std::string payload = encode_entry(entry);
    const std::lock_guard<std::mutex> lock(mutex);
    journal.append(payload);
    dataset.scenes[static_cast<std::size_t>(entry.scene.index)] = std::move(entry.scene);
    progress.update(++done);
  });
  return dataset;
}

void check_number_of_objects(std::size_t objects, const std::string& scene) {
  if (objects <= kMostObjects) return;
  throw UnusableScene(scene + ": has " + std::to_string(objects) + " objects; a scan can hold " +
                      std::to_string(kMostObjects));
}

ScanScenes scan_scenes_of(const SceneDataset& dataset) {
  ScanScenes result;
  std::map<std::array<double, 4>, int> id_of;  // by shape and scale
  for (std::size_t k = 0; k < dataset.scenes.size(); ++k) {
    const SceneRecord& record = dataset.scenes[k];
    check_number_of_objects(record.objects.size(), "scene " + std::to_string(k));
    Scene scene = to_scene(dataset, record);
    std::vector<int> ids;
    for (std::size_t i = 0; i < record.objects.size(); ++i) {
      const SceneObject& object = record.objects[i];
      const std::array<double, 4> key{static_cast<double>(object.shape), object.scale.x(), object.scale.y(),
                                      object.scale.z()};
      const auto [entry, is_new] = id_of.emplace(key, static_cast<int>(result.models.size()) + 1);
      if (is_new) result.models.push_back(scene.objects[i]);
      scene.objects[i] = result.models[static_cast<std::size_t>(entry->second) - 1];
      ids.push_back(entry->second);
    }
    result.scenes.push_back(std::move(scene));
    result.ids.push_back(std::move(ids));
  }
  return result;
}

std::string fingerprint(const ScanScenes& scenes) {
  Fnv1a hash;
  for (const ObjectPtr& model : scenes.models) {
    hash.add(model->name.data(), model->name.size());
    add_mesh(model->mesh, hash);
  }
  if (scenes.geoms) add_geoms(*scenes.geoms, hash);
  for (std::size_t k = 0; k < scenes.scenes.size(); ++k) {
    hash.add(scenes.ids[k].data(), sizeof(int) * scenes.ids[k].size());
    for (const Pose& pose : scenes.scenes[k].T_world_object) add_pose(pose, hash);
  }
  for (const ScanView& view : scenes.views) {
    hash.add(&view.camera.fy, sizeof(double));
    add_pose(view.T_world_camera, hash);
  }
  return hash.hex();
}

}  // namespace dofusion
