// The scenes of a scan and the models in them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "perception/camera.h"
#include "perception/scene_scanner.h"
#include "stability/dataset.h"
#include "stability/generation.h"

namespace dofusion {

// New scenes 0 … count - 1. `journal` keeps those that are made, so that the same call goes on after a kill. Throws
// Interrupted if the user ends the program.
SceneDataset generate_scenes(const GenerationOptions& options, std::int64_t count, int threads,
                             const std::filesystem::path& journal);

// Where an image is taken from.
struct ScanView {
  std::string name;  // the camera's in its file; may be empty
  Camera camera;
  Pose T_world_camera = Pose::Identity();
};

// Scenes of distinct solids, which are numbered from 1 as BOP's object ids.
struct ScanScenes {
  std::vector<ObjectPtr> models;
  std::vector<Scene> scenes;          // equal objects are one and the same
  std::vector<std::vector<int>> ids;  // per scene and object: index into models, plus 1
  std::optional<GeomScene> geoms;     // what the one scene is made of; none: each is its objects on the table
  std::vector<ScanView> views;        // of every scene; empty: they are sampled
};

// Throws UnusableScene, naming the scene, if it has more than 253 objects, the most that labels of 8 bits tell apart.
ScanScenes scan_scenes_of(const SceneDataset& dataset);

// The same for one scene; the message begins with `scene`.
void check_number_of_objects(std::size_t objects, const std::string& scene);

// A hash of shapes, poses and views: the same scenes, wherever they come from. 16 hexadecimal digits.
std::string fingerprint(const ScanScenes& scenes);

}  // namespace dofusion
