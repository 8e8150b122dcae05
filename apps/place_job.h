// dofusion-place's steps, from its inputs as loaded to its outputs as written.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/pipeline.h"
#include "apps/place_inputs.h"
#include "apps/placement.h"

namespace dofusion {

struct PlaceResult {
  RecoveredScene recovered;
  std::vector<Placement> placements;              // best first
  std::optional<Pose> T_world_estimate;           // that was refined; the object seen there is left out of the scene
  std::vector<std::pair<std::string, double>> timing_ms;  // in the order of the steps
};

// Whether a placement is stable and meets all wishes, by the first: they are sorted so.
bool found_placement(const PlaceResult& result);

// Runs the steps: recover the scene, sample, settle. Without a table there are no placements.
PlaceResult run_placement(const PlaceInputs& inputs, const PlaceArguments& arguments);

// placements.json's text.
std::string placements_json(const PlaceInputs& inputs, const PlaceArguments& arguments, const PlaceResult& result);

// Writes placements.json, segmentation.png, query.obj, objects/<i>.obj, scene.xml, scene.glb and report.html into
// `directory`; for unknown objects objects/<i>.mtl too, whose material "never_seen" marks what no view shows
// (perception/seen_surface.h).
void write_outputs(const std::string& directory, const PlaceInputs& inputs, const PlaceArguments& arguments,
                   PlaceResult& result);

// "Settled on the recovered scene: 28 of 32 placements are stable; the best moves 0.1 % and 0.2°." and the like.
std::string summary_line(const PlaceInputs& inputs, const PlaceResult& result);

}  // namespace dofusion
