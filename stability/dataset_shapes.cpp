#include "stability/dataset_shapes.h"

#include <cmath>

namespace dofusion {
namespace {

// Several meshes one after another: mesh k has rows start[k] … start[k+1]-1.
struct MeshTables {
  std::vector<std::int64_t> vertex_start{0}, triangle_start{0};
  std::vector<double> vertices;         // (V, 3)
  std::vector<std::int32_t> triangles;  // (T, 3), within the mesh

  void add(const TriangleMesh& mesh) {
    for (const Eigen::Vector3d& v : mesh.vertices) vertices.insert(vertices.end(), v.data(), v.data() + 3);
    for (const Eigen::Vector3i& t : mesh.triangles) triangles.insert(triangles.end(), t.data(), t.data() + 3);
    vertex_start.push_back(static_cast<std::int64_t>(vertices.size() / 3));
    triangle_start.push_back(static_cast<std::int64_t>(triangles.size() / 3));
  }
};

void write_meshes(const MeshTables& meshes, const std::string& prefix, Hdf5Writer& writer) {
  writer.table("/shapes/" + prefix + "vertex_start", meshes.vertex_start, 1);
  writer.table("/shapes/" + prefix + "vertices", meshes.vertices, 3);
  writer.table("/shapes/" + prefix + "triangle_start", meshes.triangle_start, 1);
  writer.table("/shapes/" + prefix + "triangles", meshes.triangles, 3);
}

std::vector<TriangleMesh> read_meshes(const Hdf5Reader& reader, const std::string& prefix, std::size_t count) {
  const std::string start = "/shapes/" + prefix;
  const auto vertices = reader.table<double>(start + "vertices", 3);
  const auto triangles = reader.table<std::int32_t>(start + "triangles", 3);
  const auto vertex_start = reader.table<std::int64_t>(start + "vertex_start", 1);
  const auto triangle_start = reader.table<std::int64_t>(start + "triangle_start", 1);
  check_starts(reader, start + "vertex_start", vertex_start, count, vertices.size() / 3);
  check_starts(reader, start + "triangle_start", triangle_start, count, triangles.size() / 3);
  std::vector<TriangleMesh> meshes(count);
  for (std::size_t k = 0; k < count; ++k) {
    TriangleMesh& mesh = meshes[k];
    for (std::int64_t v = vertex_start[k]; v < vertex_start[k + 1]; ++v) {
      mesh.vertices.emplace_back(vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2]);
      if (!mesh.vertices.back().allFinite()) {
        reader.fail(start + "vertices: row " + std::to_string(v) + " is not finite");
      }
    }
    for (std::int64_t t = triangle_start[k]; t < triangle_start[k + 1]; ++t) {
      const Eigen::Vector3i triangle(triangles[3 * t], triangles[3 * t + 1], triangles[3 * t + 2]);
      if (triangle.minCoeff() < 0 || triangle.maxCoeff() >= static_cast<int>(mesh.vertices.size())) {
        reader.fail(start + "triangles: row " + std::to_string(t) + " names a vertex that is not there");
      }
      mesh.triangles.push_back(triangle);
    }
  }
  return meshes;
}

// The object that was stored: its mesh is centred already, and what follows from mesh and kind is not in the file.
ObjectPtr restored(const Hdf5Reader& reader, Object stored, std::size_t row) {
  const std::string place = "/shapes: row " + std::to_string(row) + ", '" + stored.name + "', ";
  const double mesh_volume = volume(stored.mesh);
  if (!is_closed(stored.mesh) || !(mesh_volume > 0.0)) reader.fail(place + "is not a closed mesh");
  ObjectPtr object = scaled(stored, Eigen::Vector3d::Ones());
  // A primitive is made afresh; its mesh must be the one in the file, up to rounding.
  if (object->kind != stored.kind || std::abs(volume(object->mesh) / mesh_volume - 1.0) > 1e-6) {
    reader.fail(place + "is not of the kind that /shapes/kind says");
  }
  return object;
}

}  // namespace

void check_starts(const Hdf5Reader& reader, const std::string& name, const std::vector<std::int64_t>& start,
                  std::size_t count, std::size_t total) {
  bool good = start.size() == count + 1 && start.front() == 0 && start.back() == static_cast<std::int64_t>(total);
  for (std::size_t i = 0; good && i + 1 < start.size(); ++i) good = start[i] <= start[i + 1];
  if (!good) reader.fail(name + " does not fit the tables it points into");
}

std::vector<ObjectPtr> read_shapes(const Hdf5Reader& reader) {
  const auto names = reader.strings("/shapes/name");
  const auto kind = reader.table<std::uint8_t>("/shapes/kind", 1);
  if (kind.size() != names.size()) reader.fail("/shapes/kind and /shapes/name differ in length");
  std::vector<TriangleMesh> meshes = read_meshes(reader, "", names.size());
  const auto convex_start = reader.table<std::int64_t>("/shapes/convex_start", 1);
  const std::size_t solids = reader.table<std::int64_t>("/shapes/convex_vertex_start", 1).size();
  if (solids == 0) reader.fail("/shapes/convex_vertex_start is empty");
  const std::vector<TriangleMesh> convex = read_meshes(reader, "convex_", solids - 1);
  check_starts(reader, "/shapes/convex_start", convex_start, names.size(), convex.size());

  std::vector<ObjectPtr> shapes;
  for (std::size_t s = 0; s < names.size(); ++s) {
    if (kind[s] > 3) reader.fail("/shapes/kind: row " + std::to_string(s) + " is not 0, 1, 2 or 3");
    Object stored;
    stored.name = names[s];
    stored.kind = static_cast<SolidKind>(kind[s]);
    stored.mesh = std::move(meshes[s]);
    stored.parts.assign(convex.begin() + convex_start[s], convex.begin() + convex_start[s + 1]);
    shapes.push_back(restored(reader, std::move(stored), s));
  }
  return shapes;
}

void write_shapes(const std::vector<ObjectPtr>& shapes, Hdf5Writer& writer) {
  std::vector<std::string> names;
  std::vector<std::uint8_t> kind;
  std::vector<std::int64_t> convex_start{0};
  MeshTables meshes, convex;
  for (const ObjectPtr& shape : shapes) {
    names.push_back(shape->name);
    kind.push_back(static_cast<std::uint8_t>(shape->kind));
    meshes.add(shape->mesh);
    for (const TriangleMesh& solid : shape->parts) convex.add(solid);
    convex_start.push_back(static_cast<std::int64_t>(convex.vertex_start.size()) - 1);
  }
  writer.group("/shapes");
  writer.strings("/shapes/name", names);
  writer.table("/shapes/kind", kind, 1);
  write_meshes(meshes, "", writer);
  writer.table("/shapes/convex_start", convex_start, 1);
  write_meshes(convex, "convex_", writer);
}

}  // namespace dofusion
