#include "stability/mesh_import.h"

#include <algorithm>
#include <cstring>
#include <filesystem>

#include <assimp/Importer.hpp>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "stability/child_process.h"
#include "stability/files.h"

namespace dofusion {
namespace {

constexpr int kRead = 0, kRefused = 3, kTooMany = 4;  // exit statuses of the child

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

void append(ImportedMesh& mesh, const aiMesh& part) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    mesh.vertices.push_back({part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z});
  }
  for (unsigned i = 0; i < part.mNumFaces; ++i) {
    const aiFace& face = part.mFaces[i];
    if (face.mNumIndices != 3) continue;  // points and lines are no surface
    mesh.triangles.push_back({first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
  }
}

// Writes the numbers of vertices and triangles, and these; or assimp's reason, or the number that is too large.
int import_in_child(const std::string& path, std::size_t most_triangles, int pipe) {
  Assimp::Importer importer;
  // Vertices are welded by the caller, by exact position; assimp's own way would take longer.
  const aiScene* scene = importer.ReadFile(path, aiProcess_Triangulate | aiProcess_PreTransformVertices);
  if (scene == nullptr || scene->mNumMeshes == 0) {
    write_all(pipe, importer.GetErrorString());
    return kRefused;
  }
  std::size_t triangles = 0;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) triangles += scene->mMeshes[m]->mNumFaces;
  if (triangles > most_triangles) {
    write_all(pipe, std::to_string(triangles));
    return kTooMany;
  }
  ImportedMesh mesh;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) append(mesh, *scene->mMeshes[m]);
  const std::vector<std::uint64_t> sizes{mesh.vertices.size(), mesh.triangles.size()};
  const bool written = write_all(pipe, bytes_of(sizes)) && write_all(pipe, bytes_of(mesh.vertices)) &&
                       write_all(pipe, bytes_of(mesh.triangles));
  return written ? kRead : kRefused;
}

// What the child wrote of a mesh; false if the numbers do not fit the bytes, or an index no vertex.
bool unpack(const std::string& bytes, ImportedMesh& mesh) {
  std::uint64_t sizes[2];
  if (bytes.size() < sizeof sizes) return false;
  std::memcpy(sizes, bytes.data(), sizeof sizes);
  const std::size_t vertex_bytes = sizes[0] * sizeof mesh.vertices[0],
                    triangle_bytes = sizes[1] * sizeof mesh.triangles[0];
  if (bytes.size() != sizeof sizes + vertex_bytes + triangle_bytes) return false;
  mesh.vertices.resize(sizes[0]);
  mesh.triangles.resize(sizes[1]);
  if (vertex_bytes > 0) std::memcpy(mesh.vertices.data(), bytes.data() + sizeof sizes, vertex_bytes);
  if (triangle_bytes > 0)
    std::memcpy(mesh.triangles.data(), bytes.data() + sizeof sizes + vertex_bytes, triangle_bytes);
  return std::all_of(mesh.triangles.begin(), mesh.triangles.end(),
                     [&](const auto& t) { return *std::max_element(t.begin(), t.end()) < mesh.vertices.size(); });
}

}  // namespace

ImportedMesh import_mesh(const std::string& path, std::size_t most_triangles) {
  const unsigned seconds = reading_seconds(static_cast<double>(std::filesystem::file_size(path)));
  const ChildResult child =
      run_in_child([&](int pipe) { return import_in_child(path, most_triangles, pipe); }, seconds);
  if (child.end == ChildResult::End::kOutOfTime) {
    throw InputError(path + ": not a mesh that can be read (the reader does not come to an end; the file is damaged)");
  }
  ImportedMesh mesh;
  if (child.end == ChildResult::End::kReturned && child.status == kRead && unpack(child.output, mesh)) return mesh;
  if (child.end == ChildResult::End::kReturned && child.status == kTooMany) {
    throw InputError(path + ": a mesh of " + child.output + " triangles; simplify it to " +
                     std::to_string(most_triangles) + " or fewer");
  }
  const bool refused = child.end == ChildResult::End::kReturned && child.status == kRefused;
  const std::string reason = refused ? child.output : "the reader crashes; the file is damaged";
  throw InputError(path + ": not a mesh that can be read" + (reason.empty() ? "" : " (" + reason + ")"));
}

}  // namespace dofusion
