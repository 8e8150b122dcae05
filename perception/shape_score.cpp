#include "perception/shape_score.h"

#include <algorithm>
#include <cmath>

namespace dofusion {
namespace {

double explained_share(const std::vector<HalfSpace>& body, const ObjectView& view, double slack) {
  constexpr std::size_t kEnough = 1500;
  const std::size_t step = view.points.size() / kEnough + 1;
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < view.points.size(); i += step) {
    const double tolerance = 3.0 * view.sigma[i] + slack;
    const double off = plane_distance(body, view.points[i]) / tolerance;
    sum += 1.0 - std::min(1.0, off * off);
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

struct Window {
  int u0 = 0, v0 = 0, u1 = 0, v1 = 0;  // [u0, u1) x [v0, v1)
};

Window image_window(const TriangleMesh& mesh, const ViewEvidence& evidence) {
  const Pose T_camera_world = evidence.T_world_camera.inverse();
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    const Eigen::Vector3d p = T_camera_world * vertex;
    if (p.z() < 1e-3) return {0, 0, evidence.depth.width, evidence.depth.height};
    const Eigen::Vector2d pixel = project(evidence.camera, p);
    low = low.cwiseMin(pixel);
    high = high.cwiseMax(pixel);
  }
  const auto bound = [](double x, int size) { return std::clamp(static_cast<int>(std::floor(x)), 0, size); };
  return {bound(low.x(), evidence.depth.width), bound(low.y(), evidence.depth.height),
          bound(high.x() + 1.0, evidence.depth.width), bound(high.y() + 1.0, evidence.depth.height)};
}

// Pixels of other labels that see something behind the shape.
double contradicted_pixels(const TriangleMesh& mesh, const std::vector<HalfSpace>& body, int label,
                           const ViewEvidence& evidence, double slack) {
  constexpr int kStride = 3;
  const Window window = image_window(mesh, evidence);
  const Pose& T_world_camera = evidence.T_world_camera;
  int count = 0;
  for (int v = window.v0; v < window.v1; v += kStride) {
    for (int u = window.u0; u < window.u1; u += kStride) {
      const float z = evidence.depth.at(v, u);
      if (!is_valid_depth(z) || evidence.labels.at(v, u) == label) continue;
      const Eigen::Vector3d direction = T_world_camera.linear() * pixel_ray(evidence.camera, u, v);
      const std::optional<double> entry = enter(body, T_world_camera.translation(), direction);
      if (entry && *entry < z - 3.0 * evidence.sigma(z) - 2.0 * slack) ++count;
    }
  }
  return static_cast<double>(count) * kStride * kStride;
}

}  // namespace

double score_shape(const TriangleMesh& mesh, const ObjectView& view, const ShapeEvidence& evidence, double slack) {
  const std::vector<HalfSpace> body = half_spaces(mesh);
  double contradicted = 0.0;
  for (const ViewEvidence& seen : evidence) contradicted += contradicted_pixels(mesh, body, view.label, seen, slack);
  return explained_share(body, view, slack) - contradicted / std::max(1, view.pixels);
}

}  // namespace dofusion
