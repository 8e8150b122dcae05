#include "stability/dataset.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "stability/child_process.h"
#include "stability/dataset_shapes.h"
#include "stability/files.h"
#include "stability/hdf5_file.h"

namespace dofusion {
namespace {

constexpr std::int64_t kVersion = 2;

// The tables of /scenes and /objects, as they are in the file.
struct SceneTables {
  std::vector<std::int64_t> start{0}, index;
  std::vector<std::uint8_t> task, split;
  std::vector<std::int32_t> part, shape;
  std::vector<double> scale, pose;
  std::vector<std::uint32_t> touches;

  std::size_t scenes() const { return task.size(); }
};

SceneTables read_tables(const Hdf5Reader& reader) {
  SceneTables t;
  t.start = reader.table<std::int64_t>("/scenes/start", 1);
  t.task = reader.table<std::uint8_t>("/scenes/task", 1);
  t.part = reader.table<std::int32_t>("/scenes/part", 1);
  t.index = reader.table<std::int64_t>("/scenes/index", 1);
  t.split = reader.table<std::uint8_t>("/scenes/split", 1);
  t.shape = reader.table<std::int32_t>("/objects/shape", 1);
  t.scale = reader.table<double>("/objects/scale", 3);
  t.pose = reader.table<double>("/objects/pose", 7);
  t.touches = reader.table<std::uint32_t>("/objects/touches", 1);
  return t;
}

std::string row_text(std::size_t row) { return ": row " + std::to_string(row); }

void check_scenes(const Hdf5Reader& reader, const SceneTables& t) {
  const std::size_t scenes = t.scenes();
  if (t.part.size() != scenes || t.index.size() != scenes || t.split.size() != scenes) {
    reader.fail("the tables of /scenes differ in length");
  }
  check_starts(reader, "/scenes/start", t.start, scenes, t.shape.size());
  for (std::size_t i = 0; i < scenes; ++i) {
    if (t.task[i] > 2) reader.fail("/scenes/task" + row_text(i) + " is not 0, 1 or 2");
    if (t.split[i] > 2) reader.fail("/scenes/split" + row_text(i) + " is not 0, 1 or 2");
    if (t.part[i] < 0) reader.fail("/scenes/part" + row_text(i) + " is negative");
    const std::int64_t objects = t.start[i + 1] - t.start[i];
    for (std::int64_t o = t.start[i]; o < t.start[i + 1]; ++o) {
      if (objects > 31 || (static_cast<std::uint64_t>(t.touches[o]) >> (objects + 1)) != 0) {
        reader.fail("/objects/touches" + row_text(static_cast<std::size_t>(o)) +
                    " names an object that is not in the scene");
      }
    }
  }
}

void check_objects(const Hdf5Reader& reader, const SceneTables& t, std::size_t shapes) {
  const std::size_t objects = t.shape.size();
  if (t.scale.size() != 3 * objects || t.pose.size() != 7 * objects || t.touches.size() != objects) {
    reader.fail("the tables of /objects differ in length");
  }
  const auto finite = [](double value) { return std::isfinite(value); };
  for (std::size_t o = 0; o < objects; ++o) {
    if (t.shape[o] < 0 || t.shape[o] >= static_cast<std::int64_t>(shapes)) {
      reader.fail("/objects/shape" + row_text(o) + " names a shape that is not there");
    }
    const double* scale = &t.scale[3 * o];
    if (!std::all_of(scale, scale + 3, [&](double factor) { return finite(factor) && factor > 0.0; })) {
      reader.fail("/objects/scale" + row_text(o) + " is not positive");
    }
    const double* pose = &t.pose[7 * o];
    const bool turned = std::any_of(pose + 3, pose + 7, [](double q) { return q != 0.0; });
    if (!std::all_of(pose, pose + 7, finite) || !turned)
      reader.fail("/objects/pose" + row_text(o) + " is not a finite pose");
  }
}

SceneRecord record_of(const SceneTables& t, std::size_t i) {
  SceneRecord record;
  record.task = static_cast<Task>(t.task[i]);
  record.part = t.part[i];
  record.index = t.index[i];
  record.split = static_cast<Split>(t.split[i]);
  for (std::int64_t o = t.start[i]; o < t.start[i + 1]; ++o) {
    SceneObject object;
    object.shape = t.shape[o];
    object.scale = Eigen::Vector3d(t.scale[3 * o], t.scale[3 * o + 1], t.scale[3 * o + 2]);
    object.touches = t.touches[o];
    PoseArray pose;
    std::copy_n(t.pose.begin() + 7 * o, 7, pose.begin());
    object.T_world_object = from_array(pose);
    record.objects.push_back(object);
  }
  return record;
}

// A filter with the shapes' names looked up.
class SceneChoice {
 public:
  SceneChoice(const DatasetFilter& filter, const std::vector<ObjectPtr>& shapes) : filter_(filter) {
    for (const ObjectPtr& shape : shapes) {
      wanted_.push_back(shape->name == filter.with_shape);
      unwanted_.push_back(shape->name == filter.without_shape);
    }
  }

  bool takes(const SceneTables& t, std::size_t i) const {
    if (filter_.split && static_cast<Split>(t.split[i]) != *filter_.split) return false;
    const auto& tasks = filter_.tasks;
    if (!tasks.empty() && std::find(tasks.begin(), tasks.end(), static_cast<Task>(t.task[i])) == tasks.end())
      return false;
    if (filter_.objects && t.start[i + 1] - t.start[i] != *filter_.objects) return false;
    const auto has = [&](const std::vector<bool>& of_shape) {
      return std::any_of(t.shape.begin() + t.start[i], t.shape.begin() + t.start[i + 1],
                         [&](std::int32_t shape) { return of_shape[static_cast<std::size_t>(shape)]; });
    };
    return (filter_.with_shape.empty() || has(wanted_)) && (filter_.without_shape.empty() || !has(unwanted_));
  }

 private:
  const DatasetFilter& filter_;
  std::vector<bool> wanted_, unwanted_;  // by shape
};

SceneTables tables_of(const std::vector<SceneRecord>& scenes) {
  SceneTables t;
  for (const SceneRecord& record : scenes) {
    t.task.push_back(static_cast<std::uint8_t>(record.task));
    t.part.push_back(record.part);
    t.index.push_back(record.index);
    t.split.push_back(static_cast<std::uint8_t>(record.split));
    for (const SceneObject& object : record.objects) {
      t.shape.push_back(object.shape);
      t.touches.push_back(object.touches);
      t.scale.insert(t.scale.end(), object.scale.data(), object.scale.data() + 3);
      const PoseArray pose = to_array(object.T_world_object);
      t.pose.insert(t.pose.end(), pose.begin(), pose.end());
    }
    t.start.push_back(static_cast<std::int64_t>(t.shape.size()));
  }
  return t;
}

void write_tables(const SceneTables& t, Hdf5Writer& writer) {
  writer.group("/scenes");
  writer.table("/scenes/start", t.start, 1);
  writer.table("/scenes/task", t.task, 1);
  writer.table("/scenes/part", t.part, 1);
  writer.table("/scenes/index", t.index, 1);
  writer.table("/scenes/split", t.split, 1);
  writer.group("/objects");
  writer.table("/objects/shape", t.shape, 1);
  writer.table("/objects/scale", t.scale, 3);
  writer.table("/objects/pose", t.pose, 7);
  writer.table("/objects/touches", t.touches, 1);
}

std::string file_bytes(const SceneDataset& dataset) {
  Hdf5Writer writer;
  writer.text_attribute("format", "dofusion-scenes");
  writer.integer_attribute("version", kVersion);
  writer.text_attribute("settings", dataset.settings);
  write_shapes(dataset.shapes, writer);
  write_tables(tables_of(dataset.scenes), writer);
  return writer.bytes();
}

// Some bits of x, each of which depends on all of x (the finaliser of splitmix64; Steele et al. 2014).
std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

}  // namespace

std::string to_string(Task task) {
  switch (task) {
    case Task::kSingle:
      return "single";
    case Task::kUnstructured:
      return "unstructured";
    case Task::kStack:
      return "stack";
  }
  return "unknown";
}

Task task_from_string(const std::string& name) {
  for (const Task task : {Task::kSingle, Task::kUnstructured, Task::kStack}) {
    if (name == to_string(task)) return task;
  }
  throw std::invalid_argument("unknown task '" + name + "'; choose single, unstructured or stack");
}

std::string to_string(Split split) {
  switch (split) {
    case Split::kTrain:
      return "train";
    case Split::kValidation:
      return "validation";
    case Split::kTest:
      return "test";
  }
  return "unknown";
}

Split split_from_string(const std::string& name) {
  for (const Split split : {Split::kTrain, Split::kValidation, Split::kTest}) {
    if (name == to_string(split)) return split;
  }
  throw std::invalid_argument("unknown split '" + name + "'; choose train, validation or test");
}

Split split_of(std::uint64_t seed, int part, std::int64_t index, const SplitShares& shares) {
  if (!(shares.validation >= 0.0 && shares.test >= 0.0 && shares.validation + shares.test <= 1.0)) {
    throw std::invalid_argument("the shares of validation and test scenes must lie between 0 and 1 together");
  }
  const std::uint64_t hash =
      mixed(mixed(mixed(seed) ^ static_cast<std::uint64_t>(part)) ^ static_cast<std::uint64_t>(index));
  const double u = static_cast<double>(hash >> 11) * 0x1p-53;  // in [0, 1)
  if (u < shares.validation) return Split::kValidation;
  return u < shares.validation + shares.test ? Split::kTest : Split::kTrain;
}

namespace {

SceneDataset read_checked(const std::string& path, const DatasetFilter& filter) {
  const Hdf5Reader reader(path);
  if (reader.text_attribute("format") != "dofusion-scenes") reader.fail("not a dataset of scenes");
  const std::int64_t version = reader.integer_attribute("version");
  if (version != kVersion) {
    reader.fail("version " + std::to_string(version) + ", this program reads " + std::to_string(kVersion) +
                "; generate it again");
  }
  SceneDataset dataset;
  dataset.settings = reader.text_attribute("settings");
  if (!nlohmann::json::accept(dataset.settings)) reader.fail("attribute 'settings' is not JSON");
  dataset.shapes = read_shapes(reader);
  const SceneTables tables = read_tables(reader);
  check_objects(reader, tables, dataset.shapes.size());
  check_scenes(reader, tables);

  const SceneChoice choice(filter, dataset.shapes);
  for (std::size_t i = 0; i < tables.scenes(); ++i) {
    if (filter.most && dataset.scenes.size() >= *filter.most) break;
    if (choice.takes(tables, i)) dataset.scenes.push_back(record_of(tables, i));
  }
  return dataset;
}

// Reads the file once in a child process, since HDF5's library crashes on some damaged ones.
void try_in_child(const std::string& path) {
  constexpr int kRead = 0, kRefused = 3;
  std::error_code error;
  const auto bytes = static_cast<double>(std::filesystem::file_size(path, error));
  DatasetFilter none;
  none.most = 0;
  const auto read = [&](int pipe) {
    try {
      read_checked(path, none);
    } catch (const InputError& e) {
      write_all(pipe, e.what());
      return kRefused;
    }
    return kRead;
  };
  const ChildResult child = run_in_child(read, reading_seconds(error ? 0.0 : bytes));
  if (child.end == ChildResult::End::kReturned && child.status == kRead) return;
  if (child.end == ChildResult::End::kReturned && child.status == kRefused) throw InputError(child.output);
  throw InputError(path + ": damaged; the HDF5 library fails on it. Copy or generate it again");
}

}  // namespace

SceneDataset read_dataset(const std::string& path, const DatasetFilter& filter) {
  try_in_child(path);
  return read_checked(path, filter);
}

void write_dataset(const SceneDataset& dataset, const std::string& path) {
  write_file(path, file_bytes(dataset), Durability::kOnDisk);
}

Scene to_scene(const SceneDataset& dataset, const SceneRecord& record) {
  Scene scene;
  for (const SceneObject& object : record.objects) {
    const ObjectPtr& shape = dataset.shapes.at(static_cast<std::size_t>(object.shape));
    const bool shared = object.scale == Eigen::Vector3d::Ones();
    scene.objects.push_back(shared ? shape : scaled(*shape, object.scale));
    scene.T_world_object.push_back(object.T_world_object);
  }
  return scene;
}

}  // namespace dofusion
