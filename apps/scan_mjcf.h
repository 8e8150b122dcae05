// A user's MuJoCo scene, as dofusion-scan scans it.
#pragma once

#include <string>
#include <vector>

#include "apps/scan_scenes.h"
#include "perception/camera.h"

namespace dofusion {

struct MjcfScanOptions {
  std::string file, keyframe;        // stability/mjcf_scene.h
  bool settle = false;               // first, with the file's own physics
  std::vector<std::string> cameras;  // names, or "all" of the file's; empty: viewpoints are sampled
};

// One scene of one model for each body that moves, of the geoms fixed to it that viewers show (groups 0 to 2, not
// wholly transparent), in the body's frame: origin at the centre of mass. Bodies of equal shape are one model. What
// does not move is the surroundings. Scans are exact (perception/scene_scanner.h); models are tessellated
// (stability/geom_mesh.h). `camera` gives the images' size and step of depth; a camera of the file has its own focal
// length.
//   Throws InputError naming the file: as MjcfScene; if nothing to be seen moves in it; if it has no such camera, or
// none at all; if it diverges when settled. Throws Interrupted if the user ends the program while it settles.
ScanScenes scan_scenes_of_mjcf(const MjcfScanOptions& options, const Camera& camera);

}  // namespace dofusion
