#include "perception/seen_surface.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>

#include "stability/files.h"
#include "stability/mesh_io.h"

namespace dofusion {
namespace {

// Blue, and the grey of what is made up.
constexpr char kMaterials[] =
    "newmtl seen\nKd 0.26 0.47 0.75\n\n"
    "newmtl never_seen\nKd 0.62 0.62 0.62\n";

// The middles of the small triangles that a triangle splits into, evenly over it; barycentric.
std::vector<Eigen::Vector3d> even_points() {
  constexpr int kParts = 6;  // of each side
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < kParts; ++i) {
    for (int j = 0; i + j < kParts; ++j) {
      const auto at = [&](double a, double b) { points.emplace_back(a, b, 1.0 - a - b); };
      at((i + 1.0 / 3.0) / kParts, (j + 1.0 / 3.0) / kParts);
      if (i + j + 1 < kParts) at((i + 2.0 / 3.0) / kParts, (j + 2.0 / 3.0) / kParts);
    }
  }
  return points;
}

// Whether the view's reading at the point (camera's frame) shows it; `normal` is the surface's.
bool shows(const View& view, const DepthSigma& sigma, const Eigen::Vector3d& p, const Eigen::Vector3d& normal,
           double slack) {
  if (p.z() <= 0.0) return false;
  const Eigen::Vector2d pixel = project(view.camera, p);
  if (!(pixel.cwiseAbs().maxCoeff() < 1e6)) return false;
  const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
  if (!view.depth.contains(v, u) || !is_valid_depth(view.depth.at(v, u))) return false;
  const double z = view.depth.at(v, u), facing = std::max(0.1, -normal.dot(p.normalized()));
  return std::abs(z - p.z()) < 3.0 * sigma(z) + slack / facing;
}

}  // namespace

std::vector<float> seen_shares(const RecoveredObject& object, const std::vector<View>& views, double slack) {
  static const std::vector<Eigen::Vector3d> kPoints = even_points();
  const TriangleMesh& mesh = object.object->mesh;
  std::vector<float> shares(mesh.triangles.size(), 0.0f);
  for (const View& view : views) {
    const DepthSigma sigma = calibrate_sigma(view.depth, view.camera, table_of(view));
    const Pose T_camera_object = view.T_world_camera.inverse() * object.T_world_object;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      Eigen::Matrix3d corners;  // columns, camera's frame
      for (int k = 0; k < 3; ++k) corners.col(k) = T_camera_object * mesh.vertices[mesh.triangles[i][k]];
      const Eigen::Vector3d normal =
          (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).normalized();
      if (normal.dot(corners.col(0)) >= 0.0) continue;  // turned away
      const auto count = std::count_if(kPoints.begin(), kPoints.end(), [&](const Eigen::Vector3d& weights) {
        return shows(view, sigma, corners * weights, normal, slack);
      });
      shares[i] = std::max(shares[i], static_cast<float>(count) / static_cast<float>(kPoints.size()));
    }
  }
  return shares;
}

void write_seen_obj(const TriangleMesh& mesh, const std::vector<float>& shares, const std::string& path) {
  if (shares.size() != mesh.triangles.size()) {
    throw std::invalid_argument(std::to_string(shares.size()) + " shares for " + std::to_string(mesh.triangles.size()) +
                                " triangles");
  }
  const std::filesystem::path materials = std::filesystem::path(path).replace_extension(".mtl");
  std::string text = "mtllib " + materials.filename().string() + "\n" + to_obj({mesh.vertices, {}});
  for (const bool seen : {true, false}) {
    text += seen ? "usemtl seen\n" : "usemtl never_seen\n";
    for (std::size_t i = 0; i < shares.size(); ++i) {
      if ((shares[i] > 0.0f) == seen) text += obj_face(mesh.triangles[i]);
    }
  }
  write_file(materials, kMaterials);
  write_file(path, text);
}

}  // namespace dofusion
