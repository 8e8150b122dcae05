// What dofusion-place is asked to do, its inputs as loaded, and its outputs as written.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/pipeline.h"
#include "apps/placement.h"
#include "perception/camera.h"
#include "perception/image.h"

namespace dofusion {

struct PlaceArguments {
  std::string depth, cloud, camera, mask;  // files; depth or cloud
  std::string query = "cube";              // a block's name or a mesh file
  double query_unit = 1.0;                 // metres in a unit of the query's mesh file
  std::string objects;                     // folder of meshes; empty: nothing is known of the objects
  double objects_unit = 1.0;               // metres in a unit of those meshes
  std::string model;                       // empty: the shipped one
  PlacementOptions placement;
};

struct PlaceInputs {
  Camera camera;
  DepthImage depth;
  std::optional<LabelImage> mask;
  std::vector<ObjectPtr> library;
  ObjectPtr query;
  Eigen::Vector3d query_origin = Eigen::Vector3d::Zero();  // of the object's frame, in the mesh file's frame, metres
};

// Reads and checks everything; throws InputError naming the file or the argument and what is wrong.
PlaceInputs load_inputs(const PlaceArguments& arguments);

// Throws InputError if the outputs, written into `directory`, would replace one of the inputs.
void check_inputs_survive(const PlaceArguments& arguments, const std::string& directory);

// A block by name, or the solid of a mesh file. Throws InputError.
ObjectAndOffset load_query(const std::string& name_or_file, double unit);

struct PlaceResult {
  RecoveredScene recovered;
  std::vector<Placement> placements;              // best first
  std::vector<std::pair<std::string, double>> timing_ms;  // in the order of the steps
};

// Runs the steps: recover the scene, sample, settle. Without a table there are no placements.
PlaceResult run_placement(const PlaceInputs& inputs, const PlaceArguments& arguments);

// placements.json's text.
std::string placements_json(const PlaceInputs& inputs, const PlaceArguments& arguments, const PlaceResult& result);

// Writes placements.json, segmentation.png, query.obj, objects/<i>.obj, scene.xml, scene.glb and report.html into
// `directory`.
void write_outputs(const std::string& directory, const PlaceInputs& inputs, const PlaceArguments& arguments,
                   PlaceResult& result);

// "Settled on the recovered scene: 28 of 32 placements are stable; the best moves 0.1 % and 0.2°." and the like.
std::string summary_line(const PlaceInputs& inputs, const PlaceResult& result);

}  // namespace dofusion
