// One image of a dataset in BOP's layout (see bop_dataset.h): where its files are, and what took it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "perception/camera.h"

namespace dofusion {

struct BopFrame {
  std::string depth;                   // file
  Camera camera;                       // from scene_camera.json, with the size of the depth image
  std::optional<Pose> T_world_camera;  // where the dataset has cam_R_w2c and cam_t_w2c; its own world, metres
};

// Image `image` of scene `scene`. `split`: the folder of the scenes, e.g. "test"; empty: the only one that has the
// scene. Throws InputError naming what is missing or wrong, and what there is instead.
BopFrame find_bop_frame(const std::filesystem::path& dataset, const std::string& split, int scene, int image);

}  // namespace dofusion
