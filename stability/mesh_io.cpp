#include "stability/mesh_io.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <cstdio>
#include <filesystem>

#include "stability/files.h"

namespace dofusion {

TriangleMesh read_mesh(const std::string& path, double unit) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path + ": no such mesh file");
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(
      path, aiProcess_Triangulate | aiProcess_JoinIdenticalVertices | aiProcess_PreTransformVertices);
  if (scene == nullptr || scene->mNumMeshes == 0) {
    const std::string reason = importer.GetErrorString();
    throw InputError(path + ": not a mesh that can be read" + (reason.empty() ? "" : " (" + reason + ")"));
  }
  TriangleMesh mesh;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    const int first = static_cast<int>(mesh.vertices.size());
    for (unsigned i = 0; i < part.mNumVertices; ++i) {
      const Eigen::Vector3d v(part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z);
      if (!v.allFinite()) {
        throw InputError(path + ": vertex " + std::to_string(mesh.vertices.size() + 1) + " is not finite");
      }
      mesh.vertices.push_back(v * unit);
    }
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      const aiFace& face = part.mFaces[i];
      if (face.mNumIndices != 3) continue;  // points and lines are no surface
      mesh.triangles.emplace_back(first + static_cast<int>(face.mIndices[0]), first + static_cast<int>(face.mIndices[1]),
                                  first + static_cast<int>(face.mIndices[2]));
    }
  }
  mesh = weld(mesh);
  if (mesh.triangles.empty()) throw InputError(path + ": the mesh has no triangles");
  return mesh;
}

TriangleMesh read_solid_mesh(const std::string& path, double unit) {
  TriangleMesh mesh = read_mesh(path, unit);
  if (!is_closed(mesh)) {
    throw InputError(path + ": the mesh is open (some edge is not shared by two triangles); close its holes first");
  }
  const double mesh_volume = volume(mesh);
  const BoundingBox box = bounding_box(mesh);
  if (!(std::abs(mesh_volume) > 1e-9 * std::pow((box.max - box.min).norm(), 3))) {
    throw InputError(path + ": the mesh encloses no volume");
  }
  if (mesh_volume < 0.0) {
    for (Eigen::Vector3i& t : mesh.triangles) std::swap(t[1], t[2]);
  }
  return mesh;
}

std::string to_obj(const TriangleMesh& mesh) {
  std::string text;
  char line[128];
  for (const Eigen::Vector3d& v : mesh.vertices) {
    std::snprintf(line, sizeof line, "v %.9g %.9g %.9g\n", v.x(), v.y(), v.z());
    text += line;
  }
  for (const Eigen::Vector3i& t : mesh.triangles) {
    std::snprintf(line, sizeof line, "f %d %d %d\n", t[0] + 1, t[1] + 1, t[2] + 1);
    text += line;
  }
  return text;
}

void write_obj(const TriangleMesh& mesh, const std::string& path) { write_file(path, to_obj(mesh)); }

}  // namespace dofusion
