#include "stability/dataset.h"

#include <hdf5.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>

#include "stability/files.h"

namespace dofusion {
namespace {

// An HDF5 identifier, closed by the function that fits it.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t), const std::string& what) : id_(id), close_(close) {
    if (id_ < 0) throw InputError(what);
  }
  ~Handle() { close_(id_); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// HDF5 prints a stack of its own errors; ours are one line.
struct QuietErrors {
  QuietErrors() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }
};

template <class T>
hid_t native_type();
template <>
hid_t native_type<double>() { return H5T_NATIVE_DOUBLE; }
template <>
hid_t native_type<std::int64_t>() { return H5T_NATIVE_INT64; }
template <>
hid_t native_type<std::int32_t>() { return H5T_NATIVE_INT32; }
template <>
hid_t native_type<std::uint32_t>() { return H5T_NATIVE_UINT32; }
template <>
hid_t native_type<std::uint8_t>() { return H5T_NATIVE_UINT8; }

class Reader {
 public:
  explicit Reader(const std::string& path)
      : path_(path),
        file_(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose, path + ": not an HDF5 file, or damaged") {}

  // A dataset of `columns` columns (1: one-dimensional) with any number of rows.
  template <class T>
  std::vector<T> table(const std::string& name, hsize_t columns) const {
    const Handle data(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose, path_ + ": " + name + " is missing");
    const Handle space(H5Dget_space(data), H5Sclose, path_ + ": " + name + " cannot be read");
    hsize_t size[2] = {0, 1};
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank == (columns == 1 ? 1 : 2)) H5Sget_simple_extent_dims(space, size, nullptr);
    if (rank != (columns == 1 ? 1 : 2) || size[1] != columns) {
      throw InputError(path_ + ": " + name + " has the wrong shape; expected " + std::to_string(columns) + " columns");
    }
    std::vector<T> values(size[0] * columns);
    if (H5Dread(data, native_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
      throw InputError(path_ + ": " + name + " cannot be read; is it numeric and the file whole?");
    }
    return values;
  }

  std::vector<std::string> strings(const std::string& name) const {
    const Handle data(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose, path_ + ": " + name + " is missing");
    const Handle type(H5Dget_type(data), H5Tclose, path_ + ": " + name + " cannot be read");
    const Handle space(H5Dget_space(data), H5Sclose, path_ + ": " + name + " cannot be read");
    if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0) {
      throw InputError(path_ + ": " + name + " should hold strings of fixed length");
    }
    const std::size_t length = H5Tget_size(type);
    const hssize_t count = H5Sget_simple_extent_npoints(space);
    std::string bytes(length * static_cast<std::size_t>(std::max<hssize_t>(count, 0)), '\0');
    if (H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0) {
      throw InputError(path_ + ": " + name + " cannot be read");
    }
    std::vector<std::string> result;
    for (hssize_t i = 0; i < count; ++i) {
      const std::string text = bytes.substr(static_cast<std::size_t>(i) * length, length);
      result.push_back(text.substr(0, text.find('\0')));
    }
    return result;
  }

  std::string text_attribute(const std::string& name) const {
    const Handle attribute(H5Aopen(file_, name.c_str(), H5P_DEFAULT), H5Aclose,
                           path_ + ": attribute '" + name + "' is missing; is this a dataset of scenes?");
    const Handle type(H5Aget_type(attribute), H5Tclose, path_ + ": attribute '" + name + "' cannot be read");
    if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0) {
      throw InputError(path_ + ": attribute '" + name + "' should be a string of fixed length");
    }
    std::string text(H5Tget_size(type), '\0');
    H5Aread(attribute, type, text.data());
    return text.substr(0, text.find('\0'));
  }

  [[noreturn]] void fail(const std::string& what) const { throw InputError(path_ + ": " + what); }

 private:
  QuietErrors quiet_;
  std::string path_;
  Handle file_;
};

class Writer {
 public:
  explicit Writer(const std::string& path)
      : path_(path),
        file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose, path + ": cannot be created") {}

  void group(const std::string& name) {
    const Handle made(H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose,
                      path_ + ": cannot write " + name);
  }

  template <class T>
  void table(const std::string& name, const std::vector<T>& values, hsize_t columns) {
    const hsize_t size[2] = {values.size() / columns, columns};
    const Handle space(H5Screate_simple(columns == 1 ? 1 : 2, size, nullptr), H5Sclose, path_ + ": cannot write " + name);
    write(name, native_type<T>(), space, values.data());
  }

  void strings(const std::string& name, const std::vector<std::string>& values) {
    std::size_t length = 1;
    for (const std::string& value : values) length = std::max(length, value.size() + 1);
    const Handle type(string_type(length), H5Tclose, path_ + ": cannot write " + name);
    std::string bytes;
    for (std::string value : values) {
      value.resize(length, '\0');
      bytes += value;
    }
    const hsize_t size = values.size();
    const Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose, path_ + ": cannot write " + name);
    write(name, type, space, bytes.data());
  }

  void text_attribute(const std::string& name, const std::string& text) {
    const Handle type(string_type(text.size() + 1), H5Tclose, path_ + ": cannot write " + name);
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose, path_ + ": cannot write " + name);
    const Handle attribute(H5Acreate2(file_, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                           path_ + ": cannot write " + name);
    check(H5Awrite(attribute, type, text.c_str()), name);
  }

  void integer_attribute(const std::string& name, std::int64_t value) {
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose, path_ + ": cannot write " + name);
    const Handle attribute(H5Acreate2(file_, name.c_str(), H5T_STD_I64LE, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                           path_ + ": cannot write " + name);
    check(H5Awrite(attribute, H5T_NATIVE_INT64, &value), name);
  }

  void flush() { check(H5Fflush(file_, H5F_SCOPE_GLOBAL), "the file"); }

 private:
  static hid_t string_type(std::size_t length) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, length);
    H5Tset_cset(type, H5T_CSET_UTF8);
    return type;
  }

  void write(const std::string& name, hid_t type, hid_t space, const void* values) {
    const Handle data(H5Dcreate2(file_, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose,
                      path_ + ": cannot write " + name);
    check(H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), name);
  }

  void check(herr_t status, const std::string& what) const {
    if (status < 0) throw InputError(path_ + ": cannot write " + what + "; is the disk full?");
  }

  QuietErrors quiet_;
  std::string path_;
  Handle file_;
};

// `start` must run from 0 to `total` without falling.
void check_starts(const Reader& reader, const std::string& name, const std::vector<std::int64_t>& start,
                  std::size_t count, std::size_t total) {
  bool good = start.size() == count + 1 && start.front() == 0 && start.back() == static_cast<std::int64_t>(total);
  for (std::size_t i = 0; good && i + 1 < start.size(); ++i) good = start[i] <= start[i + 1];
  if (!good) reader.fail(name + " does not fit the tables it points into");
}

std::vector<BaseShape> read_shapes(const Reader& reader) {
  const auto names = reader.strings("/shapes/name");
  const auto vertices = reader.table<double>("/shapes/vertices", 3);
  const auto triangles = reader.table<std::int32_t>("/shapes/triangles", 3);
  const auto vertex_start = reader.table<std::int64_t>("/shapes/vertex_start", 1);
  const auto triangle_start = reader.table<std::int64_t>("/shapes/triangle_start", 1);
  check_starts(reader, "/shapes/vertex_start", vertex_start, names.size(), vertices.size() / 3);
  check_starts(reader, "/shapes/triangle_start", triangle_start, names.size(), triangles.size() / 3);
  std::vector<BaseShape> shapes;
  for (std::size_t s = 0; s < names.size(); ++s) {
    BaseShape shape{names[s], {}, nullptr};
    for (std::int64_t v = vertex_start[s]; v < vertex_start[s + 1]; ++v) {
      shape.mesh.vertices.emplace_back(vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2]);
      if (!shape.mesh.vertices.back().allFinite()) reader.fail("/shapes/vertices: row " + std::to_string(v) + " is not finite");
    }
    for (std::int64_t t = triangle_start[s]; t < triangle_start[s + 1]; ++t) {
      const Eigen::Vector3i triangle(triangles[3 * t], triangles[3 * t + 1], triangles[3 * t + 2]);
      if (triangle.minCoeff() < 0 || triangle.maxCoeff() >= static_cast<int>(shape.mesh.vertices.size())) {
        reader.fail("/shapes/triangles: row " + std::to_string(t) + " names a vertex that is not there");
      }
      shape.mesh.triangles.push_back(triangle);
    }
    try {
      shape.object = make_object(shape.name, shape.mesh).object;
    } catch (const std::invalid_argument& e) {
      reader.fail(std::string("/shapes: ") + e.what());
    }
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

}  // namespace

std::string to_string(Task task) {
  switch (task) {
    case Task::kSingle: return "single";
    case Task::kUnstructured: return "unstructured";
    case Task::kStack: return "stack";
  }
  return "unknown";
}

Task task_from_string(const std::string& name) {
  for (const Task task : {Task::kSingle, Task::kUnstructured, Task::kStack}) {
    if (name == to_string(task)) return task;
  }
  throw std::invalid_argument("unknown task '" + name + "'; choose single, unstructured or stack");
}

SceneDataset read_dataset(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path + ": no such dataset");
  const Reader reader(path);
  if (reader.text_attribute("format") != "dofusion-scenes") reader.fail("not a dataset of scenes");
  SceneDataset dataset;
  dataset.settings = reader.text_attribute("settings");
  dataset.shapes = read_shapes(reader);

  const auto start = reader.table<std::int64_t>("/scenes/start", 1);
  const auto task = reader.table<std::uint8_t>("/scenes/task", 1);
  const auto index = reader.table<std::int64_t>("/scenes/index", 1);
  const auto shape = reader.table<std::int32_t>("/objects/shape", 1);
  const auto scale = reader.table<double>("/objects/scale", 3);
  const auto pose = reader.table<double>("/objects/pose", 7);
  const auto touches = reader.table<std::uint32_t>("/objects/touches", 1);
  if (index.size() != task.size()) reader.fail("/scenes/index and /scenes/task differ in length");
  if (scale.size() != 3 * shape.size() || pose.size() != 7 * shape.size() || touches.size() != shape.size()) {
    reader.fail("the tables of /objects differ in length");
  }
  check_starts(reader, "/scenes/start", start, task.size(), shape.size());

  for (std::size_t i = 0; i < task.size(); ++i) {
    if (task[i] > 2) reader.fail("/scenes/task: row " + std::to_string(i) + " is not 0, 1 or 2");
    SceneRecord record;
    record.task = static_cast<Task>(task[i]);
    record.index = index[i];
    for (std::int64_t o = start[i]; o < start[i + 1]; ++o) {
      SceneObject object;
      object.shape = shape[o];
      object.scale = Eigen::Vector3d(scale[3 * o], scale[3 * o + 1], scale[3 * o + 2]);
      object.touches = touches[o];
      PoseArray values;
      std::copy_n(pose.begin() + 7 * o, 7, values.begin());
      object.T_world_object = from_array(values);
      const std::string row = ": row " + std::to_string(o);
      if (object.shape < 0 || object.shape >= static_cast<int>(dataset.shapes.size())) {
        reader.fail("/objects/shape" + row + " names a shape that is not there");
      }
      if (!(object.scale.minCoeff() > 0.0) || !object.scale.allFinite()) {
        reader.fail("/objects/scale" + row + " is not positive");
      }
      if (!object.T_world_object.matrix().allFinite()) reader.fail("/objects/pose" + row + " is not a finite pose");
      record.objects.push_back(object);
    }
    dataset.scenes.push_back(std::move(record));
  }
  return dataset;
}

void write_dataset(const SceneDataset& dataset, const std::string& path) {
  std::vector<std::string> names;
  std::vector<double> vertices, scale, pose;
  std::vector<std::int32_t> triangles, shape;
  std::vector<std::int64_t> vertex_start{0}, triangle_start{0}, start{0}, index;
  std::vector<std::uint8_t> task;
  std::vector<std::uint32_t> touches;
  for (const BaseShape& base : dataset.shapes) {
    names.push_back(base.name);
    for (const Eigen::Vector3d& v : base.mesh.vertices) vertices.insert(vertices.end(), v.data(), v.data() + 3);
    for (const Eigen::Vector3i& t : base.mesh.triangles) triangles.insert(triangles.end(), t.data(), t.data() + 3);
    vertex_start.push_back(static_cast<std::int64_t>(vertices.size() / 3));
    triangle_start.push_back(static_cast<std::int64_t>(triangles.size() / 3));
  }
  for (const SceneRecord& record : dataset.scenes) {
    task.push_back(static_cast<std::uint8_t>(record.task));
    index.push_back(record.index);
    for (const SceneObject& object : record.objects) {
      shape.push_back(object.shape);
      touches.push_back(object.touches);
      scale.insert(scale.end(), object.scale.data(), object.scale.data() + 3);
      const PoseArray values = to_array(object.T_world_object);
      pose.insert(pose.end(), values.begin(), values.end());
    }
    start.push_back(static_cast<std::int64_t>(shape.size()));
  }

  const std::string temporary = path + ".tmp" + std::to_string(::getpid());
  try {
    Writer writer(temporary);
    writer.text_attribute("format", "dofusion-scenes");
    writer.integer_attribute("version", 1);
    writer.text_attribute("settings", dataset.settings);
    for (const char* group : {"/shapes", "/scenes", "/objects"}) writer.group(group);
    writer.strings("/shapes/name", names);
    writer.table("/shapes/vertex_start", vertex_start, 1);
    writer.table("/shapes/vertices", vertices, 3);
    writer.table("/shapes/triangle_start", triangle_start, 1);
    writer.table("/shapes/triangles", triangles, 3);
    writer.table("/scenes/start", start, 1);
    writer.table("/scenes/task", task, 1);
    writer.table("/scenes/index", index, 1);
    writer.table("/objects/shape", shape, 1);
    writer.table("/objects/scale", scale, 3);
    writer.table("/objects/pose", pose, 7);
    writer.table("/objects/touches", touches, 1);
    writer.flush();
  } catch (const InputError& e) {
    std::remove(temporary.c_str());
    throw InputError(path + ": cannot be written (" + e.what() + ")");
  }
  std::error_code error;
  std::filesystem::rename(temporary, path, error);
  if (error) throw InputError(path + ": cannot be written (" + error.message() + ")");
}

Scene to_scene(const SceneDataset& dataset, const SceneRecord& record) {
  Scene scene;
  for (const SceneObject& object : record.objects) {
    const BaseShape& base = dataset.shapes.at(static_cast<std::size_t>(object.shape));
    const bool shared = base.object && object.scale == Eigen::Vector3d::Ones();
    scene.objects.push_back(shared ? base.object : make_object(base.name, scaled(base.mesh, object.scale)).object);
    scene.T_world_object.push_back(object.T_world_object);
  }
  return scene;
}

}  // namespace dofusion
