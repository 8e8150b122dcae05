// Stable scenes in an HDF5 file, readable by h5py.
//
//   attributes of the root   format = "dofusion-scenes", version = 1, settings = JSON text of how it was made
//   /shapes/name             (S) strings: base shapes
//   /shapes/vertex_start     (S+1) int64 into vertices        /shapes/vertices   (V, 3) float64, metres
//   /shapes/triangle_start   (S+1) int64 into triangles       /shapes/triangles  (T, 3) int32, within the shape
//   /scenes/start            (N+1) int64 into objects: scene i has objects start[i] … start[i+1]-1
//   /scenes/task             (N) uint8: 0 single, 1 unstructured, 2 stack
//   /scenes/index            (N) int64: the scene's number in its job; with the seed it repeats the scene
//   /objects/shape           (M) int32 into shapes
//   /objects/scale           (M, 3) float64: the base shape's vertices are multiplied by it, axis by axis
//   /objects/pose            (M, 7) float64: x y z, qw qx qy qz of T_world_object; in stacks bottom first
//   /objects/touches         (M) uint32: bit 0 the table, bit 1+j the scene's object j
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stability/scene.h"

namespace dofusion {

enum class Task : std::uint8_t { kSingle = 0, kUnstructured = 1, kStack = 2 };
std::string to_string(Task task);
Task task_from_string(const std::string& name);  // throws std::invalid_argument naming the choices

struct SceneObject {
  int shape = 0;                                       // index into SceneDataset::shapes
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  Pose T_world_object = Pose::Identity();
  std::uint32_t touches = 0;                           // bit 0 the table, bit 1+j object j of the scene
};

struct SceneRecord {
  Task task = Task::kSingle;
  std::int64_t index = 0;
  std::vector<SceneObject> objects;
};

struct BaseShape {
  std::string name;
  TriangleMesh mesh;  // origin at the centre of mass; scaling along the axes keeps it there
  ObjectPtr object;   // the same at scale 1, so that scenes share it and its simulators; may be null
};

struct SceneDataset {
  std::vector<BaseShape> shapes;
  std::vector<SceneRecord> scenes;
  std::string settings;  // JSON text
};

// Throws std::runtime_error naming the file and the part of it that is missing, of a wrong type, size or value.
SceneDataset read_dataset(const std::string& path);

// Writes to a temporary name and renames. Throws std::runtime_error naming the file.
void write_dataset(const SceneDataset& dataset, const std::string& path);

// The scene's objects, made from base shapes and scales (boxes recognised).
Scene to_scene(const SceneDataset& dataset, const SceneRecord& record);

}  // namespace dofusion
