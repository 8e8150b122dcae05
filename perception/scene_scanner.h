// What is scanned for a dataset, whatever it is made of: solids on a table, or a MuJoCo file's geoms.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "perception/camera.h"
#include "perception/picture.h"
#include "perception/scanner.h"
#include "stability/geom.h"
#include "stability/scene.h"

namespace dofusion {

// Pixels [u0, u1) x [v0, v1) of the image plane; they may lie beyond the image.
struct PixelWindow {
  int u0 = 0, v0 = 0, u1 = 0, v1 = 0;
};

// What the camera sees of a scene.
struct Shot {
  Scan scan;            // exact; labels 2 + i for the scene's object i, 1 for all else
  ColourImage picture;  // for people
};

// Not to be shared between threads.
class SceneScanner {
 public:
  virtual ~SceneScanner() = default;

  // `fine`: the picture has soft shadows (shaded_picture); else it is a quick_picture. Throws std::invalid_argument
  // unless the camera has a positive size and focal length.
  virtual Shot shoot(const Camera& camera, const Pose& T_world_camera, bool fine) const = 0;

  // Where object i would be seen with nothing before it: kLabelNothing elsewhere. As large as the window.
  virtual LabelImage silhouette(int object, const Camera& camera, const Pose& T_world_camera,
                                const PixelWindow& window) const = 0;

  // Why a camera at this place shows nothing of use: it is under the table, behind a plane, or inside something. Empty:
  // it does.
  virtual std::string viewpoint_problem(const Pose& T_world_camera) const = 0;
};

// The objects of a scene on the table.
std::unique_ptr<SceneScanner> make_scene_scanner(const Scene& scene);

// A scene of MuJoCo's geoms, all of which are shown.
struct GeomScene {
  std::vector<Geom> geoms;
  std::vector<Pose> T_world_body;   // where the geoms' bodies are
  std::vector<int> object_of_body;  // index of the object that the body is; -1: part of the surroundings
  std::vector<std::string> body_names;
};

// Exact for every type of geom (perception/geom_scanner.h), pictures in the geoms' own colours. Throws
// std::invalid_argument as GeomScanner, or if a body lacks one of the three.
std::unique_ptr<SceneScanner> make_scene_scanner(const GeomScene& scene);

}  // namespace dofusion
