// What dofusion-place is asked to do, and its inputs as loaded.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/placement.h"
#include "apps/pose_file.h"
#include "apps/refine.h"
#include "apps/wishes.h"
#include "perception/camera.h"
#include "perception/image.h"
#include "perception/views.h"

namespace dofusion {

struct PlaceView {
  std::string depth, camera, pose;  // files; the pose is T_world_camera in a frame that all views share
};

struct PlaceArguments {
  std::string depth, cloud, camera, mask;  // files; depth or cloud
  std::vector<PlaceView> views;            // instead: several images
  std::string bop;                         // instead: the folder of a BOP dataset, and which of its images
  std::string split;                       // empty: the only one that has the scene
  int scene = 0;
  std::vector<int> images = {0};
  bool bop_models = false;                 // the objects on the table are among the dataset's models
  std::string query = "cube";              // a block's name or a mesh file
  double query_unit = 1.0;                 // metres in a unit of the query's mesh file
  std::string objects;                     // folder of meshes; empty: nothing is known of the objects
  double objects_unit = 1.0;               // metres in a unit of those meshes
  std::string model;                       // empty: the shipped one
  Wishes wishes;
  std::string refine;                      // file of a noisy T_camera_query or T_world_query; empty: none
  double refine_noise = kRefineSigma;      // where the reverse process begins (refine.h)
  PlacementOptions placement;
};

struct PlaceInputs {
  std::string source;  // file of the first image
  Camera camera;       // of the first image, as `depth`
  DepthImage depth;
  std::optional<Pose> T_given_camera;  // of the first image, in the frame of the views' poses or of the BOP dataset
  std::vector<View> more_views;        // T_world_camera in that frame
  std::optional<LabelImage> mask;
  std::vector<ObjectPtr> library;
  ObjectPtr query;
  std::optional<NamedPose> estimate;   // of the query's pose, by the name of its frame
  Eigen::Vector3d query_origin = Eigen::Vector3d::Zero();  // of the object's frame, in the mesh file's frame, metres
};

// Of a mesh of `query` or `objects`, in its file: beyond, finding its convex parts takes minutes.
inline constexpr std::size_t kMostSolidTriangles = 100000;

// Reads and checks everything; throws InputError naming the file or the argument and what is wrong. A mesh of more than
// kMostSolidTriangles is such an error, whatever else is wrong with it; a million triangles take seconds to be refused.
PlaceInputs load_inputs(const PlaceArguments& arguments);

// Throws InputError if the outputs, written into `directory`, would replace one of the inputs.
void check_inputs_survive(const PlaceArguments& arguments, const std::string& directory);

// A block by name, or the solid of a mesh file. Throws InputError.
ObjectAndOffset load_query(const std::string& name_or_file, double unit);

}  // namespace dofusion
