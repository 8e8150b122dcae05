// Synthetic scans as a dataset in the layout of the BOP benchmark (Hodan et al. 2018; scene-wise format):
//
//   camera.json                               the default camera
//   models/obj_000001.ply, models_info.json   meshes in millimetres, with symmetries
//   <split>/000000/                           one folder a scene, one image a viewpoint
//     rgb/000000.png  depth/000000.png        shaded picture; 16-bit depth in steps of depth_scale
//     mask/000000_000000.png                  silhouette of one object, what hides it ignored
//     mask_visib/000000_000000.png            its visible part
//     pcd/000000.pcd                          on request: the depth as organised points, camera frame, metres
//     scene_camera.json                       camera and pose as the user believes them to be (SyntheticView::believed)
//     scene_gt.json  scene_gt_info.json       where objects are before the true camera, which saw the image
//
// tests/apps/bop_format_test.cpp reads such a dataset with code of its own and says what every file and key means.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "perception/camera.h"
#include "perception/picture.h"
#include "perception/scene_scanner.h"
#include "perception/synthetic_view.h"
#include "stability/files.h"
#include "stability/scene.h"

namespace dofusion {

// Writes `dataset`/camera.json and `dataset`/models on `threads` threads; model i gets the id i + 1. Models keep the
// origin of their objects' frame. models_info.json is written last. Throws InputError naming the file that cannot be
// written, as all functions here.
void write_bop_models(const std::vector<ObjectPtr>& models, const Camera& camera, const std::filesystem::path& dataset,
                      int threads = 1);

// The folder of a scene, e.g. "000012".
std::string bop_scene_name(int scene);

// A scene that no dataset can hold; the message does not name the scene.
class UnusableScene : public InputError {
  using InputError::InputError;
};

// Writes the images of one scene. Several may write different images of one scene at once.
class BopSceneWriter {
 public:
  // `scanner` is one of this scene, for silhouettes, and must outlive the writer. `model_ids` are the objects' ids in
  // the dataset, from 1. Makes the scene's folders, with those of clouds if `clouds`. Throws std::invalid_argument if
  // the number of ids is wrong.
  BopSceneWriter(const Scene& scene, const SceneScanner& scanner, const std::vector<int>& model_ids,
                 const std::filesystem::path& folder, bool clouds = false);
  ~BopSceneWriter();

  // Writes the files of image number `image`, and last of all its record, a file that finish_bop_scene uses.
  void add(int image, const Camera& camera, const SyntheticView& view, const ColourImage& rgb);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// True if the image has its record: its files are whole, whatever happened since.
bool has_bop_image(const std::filesystem::path& folder, int image);

// Makes the scene's JSON files of the records of images 0 … images - 1, and removes the records. Throws UnusableScene
// if an object of the scene lies outside every image, InputError if a record is missing or damaged.
void finish_bop_scene(const std::filesystem::path& folder, int images, const Scene& scene);

}  // namespace dofusion
