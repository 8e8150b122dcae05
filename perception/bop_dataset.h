// Synthetic scans as a dataset in the layout of the BOP benchmark (Hodan et al. 2018; scene-wise format):
//
//   camera.json                               the default camera
//   models/obj_000001.ply, models_info.json   meshes in millimetres, origin at the centre of mass
//   <split>/000000/                           one folder a scene, one image a viewpoint
//     rgb/000000.png  depth/000000.png        shaded picture; 16-bit depth in steps of depth_scale
//     mask/000000_000000.png                  silhouette of one object, what hides it ignored
//     mask_visib/000000_000000.png            its visible part
//     scene_camera.json  scene_gt.json  scene_gt_info.json
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "perception/camera.h"
#include "perception/picture.h"
#include "perception/synthetic_view.h"
#include "stability/scene.h"

namespace dofusion {

// Writes `dataset`/camera.json and `dataset`/models; model i gets the id i + 1. Throws InputError naming the file
// that cannot be written, as all functions here.
void write_bop_models(const std::vector<ObjectPtr>& models, const Camera& camera, const std::filesystem::path& dataset);

// The folder of a scene, e.g. "000012".
std::string bop_scene_name(int scene);

// Writes one scene's folder, image by image.
class BopSceneWriter {
 public:
  // `model_ids` are the objects' ids in the dataset, from 1. Throws std::invalid_argument if their number is wrong.
  BopSceneWriter(const Scene& scene, const std::vector<int>& model_ids, const Camera& camera,
                 const std::filesystem::path& folder);
  ~BopSceneWriter();

  void add(const SyntheticView& view, const ColourImage& rgb);
  void finish();  // writes the scene's JSON files

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dofusion
