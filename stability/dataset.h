// Stable scenes in an HDF5 file, readable by h5py. Layout, version 2 (S shapes, C convex solids, N scenes, M objects):
//
//   attributes of the root   format = "dofusion-scenes", version = 2, settings = JSON text of how it was made:
//                            "seed", "split" (shares) and "parts", a list of jobs with their task, objects, shapes,
//                            count, seed and physics
//   /shapes/name             (S) strings
//   /shapes/kind             (S) uint8: 0 mesh, 1 box, 2 cylinder about z, 3 sphere; these fill their mesh's box
//   /shapes/vertex_start     (S+1) int64 into vertices        /shapes/vertices   (V, 3) float64, metres
//   /shapes/triangle_start   (S+1) int64 into triangles       /shapes/triangles  (T, 3) int32, within the shape
//   /shapes/convex_start     (S+1) int64: shape s that is not convex is made of convex solids start[s] … start[s+1]-1
//   /shapes/convex_vertex_start (C+1), convex_vertices (., 3), convex_triangle_start (C+1), convex_triangles (., 3):
//                            those solids, in the shape's frame, as above
//   /scenes/start            (N+1) int64 into objects: scene i has objects start[i] … start[i+1]-1
//   /scenes/task             (N) uint8: 0 single, 1 unstructured, 2 stack
//   /scenes/part             (N) int32 into settings["parts"]
//   /scenes/index            (N) int64: the scene's number in its part; with that part's settings it repeats the scene
//   /scenes/split            (N) uint8: 0 train, 1 validation, 2 test
//   /objects/shape           (M) int32 into shapes
//   /objects/scale           (M, 3) float64: the shape's vertices are multiplied by it, axis by axis
//   /objects/pose            (M, 7) float64: x y z, qw qx qy qz of T_world_object; in stacks bottom first
//   /objects/touches         (M) uint32: bit 0 the table, bit 1+j the scene's object j
//
// Integers and floats are little-endian. Any object of a scene can be the query. Scenes stand in the order of their
// parts and indices, so that the same settings give the same bytes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stability/scene.h"

namespace dofusion {

enum class Task : std::uint8_t { kSingle = 0, kUnstructured = 1, kStack = 2 };
std::string to_string(Task task);
Task task_from_string(const std::string& name);  // throws std::invalid_argument naming the choices

enum class Split : std::uint8_t { kTrain = 0, kValidation = 1, kTest = 2 };
std::string to_string(Split split);
Split split_from_string(const std::string& name);  // throws std::invalid_argument naming the choices

// Shares of the scenes; the rest is for training.
struct SplitShares {
  double validation = 0.01;
  double test = 0.01;
};

// Where a scene belongs: a hash of the job's seed, the part and the index, so that a scene keeps its place however many
// are made, and has nothing to do with what is in it. Throws std::invalid_argument if the shares are not in [0, 1].
Split split_of(std::uint64_t seed, int part, std::int64_t index, const SplitShares& shares = {});

struct SceneObject {
  int shape = 0;  // index into SceneDataset::shapes
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  Pose T_world_object = Pose::Identity();
  std::uint32_t touches = 0;  // bit 0 the table, bit 1+j object j of the scene
};

struct SceneRecord {
  Task task = Task::kSingle;
  int part = 0;            // index into the settings' list of parts
  std::int64_t index = 0;  // within the part
  Split split = Split::kTrain;
  std::vector<SceneObject> objects;
};

struct SceneDataset {
  std::vector<ObjectPtr> shapes;  // at scale 1; scenes share them and their simulators
  std::vector<SceneRecord> scenes;
  std::string settings;  // JSON text
};

// Which scenes of a file to take: those that meet every condition.
struct DatasetFilter {
  std::optional<Split> split;
  std::vector<Task> tasks;          // one of these; empty: any
  std::optional<int> objects;       // exactly so many
  std::string with_shape;           // at least one object of this name; empty: any
  std::string without_shape;        // no object of this name; empty: any
  std::optional<std::size_t> most;  // the first so many of what meets the rest
};

// Throws InputError naming the file and the part of it that is missing, of a wrong type, size or value; or that it is
// of another version, damaged, or open for writing elsewhere. The whole file is checked, whatever the filter takes, and
// first in a child process, since HDF5's library crashes on some damaged files: within 2 s of processor time and 2 s more
// for every megabyte.
SceneDataset read_dataset(const std::string& path, const DatasetFilter& filter = {});

// Made in memory, written under a temporary name, flushed to the disk and renamed: a file that was there stays as it
// was until the new one is whole. Throws InputError naming the file.
void write_dataset(const SceneDataset& dataset, const std::string& path);

// The scene's objects, made from shapes and scales.
Scene to_scene(const SceneDataset& dataset, const SceneRecord& record);

}  // namespace dofusion
