// The models of a BOP dataset; see bop_dataset.h.
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "perception/bop_dataset.h"
#include "stability/files.h"
#include "stability/parallel_for.h"
#include "stability/shape_symmetry.h"

namespace dofusion {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr double kMillimetres = 1000.0;  // in a metre

// A vertex's normal is the mean of its triangles' weighted by their angles there (Thuerrner and Wuethrich 1998).
std::vector<Eigen::Vector3d> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d normal =
        (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]).stableNormalized();
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d& corner = mesh.vertices[t[k]];
      const Eigen::Vector3d a = mesh.vertices[t[(k + 1) % 3]] - corner, b = mesh.vertices[t[(k + 2) % 3]] - corner;
      normals[t[k]] += std::atan2(a.cross(b).norm(), a.dot(b)) * normal;
    }
  }
  for (Eigen::Vector3d& normal : normals) normal.stableNormalize();
  return normals;
}

std::string to_ply_mm(const TriangleMesh& mesh) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(mesh.vertices.size()) +
                     "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\n"
                     "property float nz\nelement face " +
                     std::to_string(mesh.triangles.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  char line[160];
  const std::vector<Eigen::Vector3d> normals = vertex_normals(mesh);
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Eigen::Vector3d mm = kMillimetres * mesh.vertices[i];
    const Eigen::Vector3d& n = normals[i];
    std::snprintf(line, sizeof line, "%.9g %.9g %.9g %.6g %.6g %.6g\n", mm.x(), mm.y(), mm.z(), n.x(), n.y(), n.z());
    text += line;
  }
  for (const Eigen::Vector3i& t : mesh.triangles) {
    std::snprintf(line, sizeof line, "3 %d %d %d\n", t[0], t[1], t[2]);
    text += line;
  }
  return text;
}

Json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json discrete_json(const Eigen::Matrix3d& R, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d t = kMillimetres * (centre - R * centre);
  Json values = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) values.push_back(R(row, column));
    values.push_back(t[row]);
  }
  for (const double value : {0.0, 0.0, 0.0, 1.0}) values.push_back(value);
  return values;
}

// As in BOP's own files, a list that would be empty is left out. A ball has three axes, at right angles.
Json symmetries_json(const ShapeSymmetry& symmetry) {
  std::vector<Eigen::Vector3d> axes;
  if (symmetry.axis) axes = {*symmetry.axis};
  if (symmetry.ball) axes = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ()};
  const Json offset = vector_json(kMillimetres * symmetry.centre);
  Json json = Json::object();
  for (const Eigen::Matrix3d& R : symmetry.rotations) {
    json["symmetries_discrete"].push_back(discrete_json(R, symmetry.centre));
  }
  for (const Eigen::Vector3d& axis : axes) {
    json["symmetries_continuous"].push_back({{"axis", vector_json(axis)}, {"offset", offset}});
  }
  return json;
}

Json model_info(const Object& object) {
  const BoundingBox box = bounding_box(object.mesh);
  const Eigen::Vector3d min = kMillimetres * box.min, size = kMillimetres * (box.max - box.min);
  Json json{{"diameter", kMillimetres * object.diameter},
            {"min_x", min.x()},
            {"min_y", min.y()},
            {"min_z", min.z()},
            {"size_x", size.x()},
            {"size_y", size.y()},
            {"size_z", size.z()}};
  // A mesh need not have its origin at the centre of mass.
  json.update(symmetries_json(object.kind == SolidKind::kMesh ? symmetry_of(object.mesh) : symmetry_of(object)));
  json["name"] = object.name;
  return json;
}

std::string model_file(int id) {
  char text[32];
  std::snprintf(text, sizeof text, "obj_%06d.ply", id);
  return text;
}

}  // namespace

void write_bop_models(const std::vector<ObjectPtr>& models, const Camera& camera, const fs::path& dataset,
                      int threads) {
  std::error_code error;
  fs::create_directories(dataset / "models", error);
  if (error) throw InputError((dataset / "models").string() + ": cannot be created: " + error.message());
  write_camera(camera, (dataset / "camera.json").string());
  std::vector<Json> infos(models.size());
  parallel_for(static_cast<std::int64_t>(models.size()), threads, [&](std::int64_t i, int) {
    const auto index = static_cast<std::size_t>(i);
    infos[index] = model_info(*models[index]);
    write_file(dataset / "models" / model_file(static_cast<int>(i) + 1), to_ply_mm(models[index]->mesh));
  });
  Json info = Json::object();
  for (std::size_t i = 0; i < infos.size(); ++i) info[std::to_string(i + 1)] = std::move(infos[i]);
  // Names in MJCF files need not be UTF-8.
  write_file(dataset / "models" / "models_info.json", info.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace dofusion
