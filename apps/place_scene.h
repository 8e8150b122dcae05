// What dofusion-place found as a glTF scene: the table, the objects, the query, the readings, and how each placement
// settles.
#pragma once

#include <string>
#include <vector>

#include "apps/gltf.h"
#include "apps/place_job.h"
#include "apps/settling_motion.h"

namespace dofusion {

// Nodes "table", "object <i>: <name>" ("object <i>" where nothing was known of it), "query: <name>" (at the best
// placement; absent without placements), "observed" (the readings of all views around the objects, thinned out evenly), and the
// depth camera. One animation per motion, "rank 1" and so on, of all objects and the query. Faces of unknown objects
// that no reading shows have a paler material, "… (not seen)". Without a table there is nothing in it.
GltfScene place_scene(const PlaceInputs& inputs, const PlaceResult& result, const std::vector<SettlingMotion>& motions);

// The bytes of scene.glb: that scene, with the placements' motions simulated.
std::string scene_glb(const PlaceInputs& inputs, const PlaceResult& result, const PlacementOptions& options);

}  // namespace dofusion
