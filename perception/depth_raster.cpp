#include "perception/depth_raster.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dofusion {
namespace {

constexpr double kNear = 1e-3;  // metres; what is nearer than this is behind the camera

struct Span {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void add(double u) {
    low = std::min(low, u);
    high = std::max(high, u);
  }
};

// Where the edge from (u0, v0) to (u1, v1) crosses row v, added to the span.
void add_crossing(double u0, double v0, double u1, double v1, double v, Span& span) {
  if ((v0 < v && v1 < v) || (v0 > v && v1 > v)) return;
  if (v0 == v1) {
    span.add(u0);
    span.add(u1);
  } else {
    span.add(u0 + (u1 - u0) * (v - v0) / (v1 - v0));
  }
}

// Without branches, so that the compiler takes several pixels at once.
void fill_span(float w0, float per_u, int count, float facing, std::int32_t index, float* __restrict inverse_depth,
               float* __restrict facings, std::int32_t* __restrict faces) {
  for (int i = 0; i < count; ++i) {
    const float w = w0 + per_u * static_cast<float>(i);
    const bool nearer = w > inverse_depth[i];
    inverse_depth[i] = nearer ? w : inverse_depth[i];
    facings[i] = nearer ? facing : facings[i];
    faces[i] = nearer ? index : faces[i];
  }
}

}  // namespace

const RasterPatch& DepthRaster::render(const TriangleMesh& mesh, const Pose& T_camera_object) {
  if (!project_vertices(mesh, T_camera_object)) {
    patch_.width = patch_.height = 0;
    return patch_;
  }
  const std::size_t size = static_cast<std::size_t>(patch_.width) * patch_.height;
  patch_.inverse_depth.assign(size, 0.0f);
  // What an earlier patch left of these is behind no surface.
  patch_.face.resize(size);
  patch_.facing.resize(size);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) fill_triangle(mesh.triangles[t], static_cast<int>(t));
  return patch_;
}

// Fills vertices_ and sets the patch to their bounding box; false if nothing can be in the image.
bool DepthRaster::project_vertices(const TriangleMesh& mesh, const Pose& T_camera_object) {
  const Eigen::Matrix3d R = T_camera_object.linear();
  const Eigen::Vector3d t = T_camera_object.translation();
  vertices_.resize(mesh.vertices.size());
  Span columns, rows;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    ScreenVertex& vertex = vertices_[i];
    vertex.p_camera = R * mesh.vertices[i] + t;
    if (vertex.p_camera.z() < kNear) continue;
    const Eigen::Vector2d pixel = project(camera_, vertex.p_camera);
    vertex.u = pixel.x();
    vertex.v = pixel.y();
    columns.add(vertex.u);
    rows.add(vertex.v);
  }
  patch_.u0 = static_cast<int>(std::ceil(std::clamp(columns.low, 0.0, camera_.width + 0.0)));
  patch_.v0 = static_cast<int>(std::ceil(std::clamp(rows.low, 0.0, camera_.height + 0.0)));
  patch_.width = static_cast<int>(std::floor(std::clamp(columns.high, -1.0, camera_.width - 1.0))) - patch_.u0 + 1;
  patch_.height = static_cast<int>(std::floor(std::clamp(rows.high, -1.0, camera_.height - 1.0))) - patch_.v0 + 1;
  return patch_.width > 0 && patch_.height > 0;
}

// One over depth is linear in the pixel on a plane: n·p = d and p = z·ray give 1/z = n·ray / d.
void DepthRaster::fill_triangle(const Eigen::Vector3i& triangle, std::int32_t index) {
  const ScreenVertex& a = vertices_[triangle[0]];
  const ScreenVertex& b = vertices_[triangle[1]];
  const ScreenVertex& c = vertices_[triangle[2]];
  if (std::min({a.p_camera.z(), b.p_camera.z(), c.p_camera.z()}) < kNear) return;
  const Eigen::Vector3d n = (b.p_camera - a.p_camera).cross(c.p_camera - a.p_camera);
  const double d = n.dot(a.p_camera);
  if (d >= 0.0) return;  // seen from behind
  const Eigen::Vector3d middle = a.p_camera + b.p_camera + c.p_camera;
  const auto facing = static_cast<float>(-n.dot(middle) / (n.norm() * middle.norm()));
  const double per_u = n.x() / (camera_.fx * d);
  const double per_v = n.y() / (camera_.fy * d);
  const double at_origin = n.z() / d - per_u * camera_.cx - per_v * camera_.cy;

  const int row_low = std::max(patch_.v0, static_cast<int>(std::ceil(std::min({a.v, b.v, c.v}))));
  const int row_high = std::min(patch_.v0 + patch_.height - 1, static_cast<int>(std::floor(std::max({a.v, b.v, c.v}))));
  for (int row = row_low; row <= row_high; ++row) {
    Span span;
    add_crossing(a.u, a.v, b.u, b.v, row, span);
    add_crossing(b.u, b.v, c.u, c.v, row, span);
    add_crossing(c.u, c.v, a.u, a.v, row, span);
    if (!(span.low <= span.high)) continue;
    const int low = std::max(patch_.u0, static_cast<int>(std::ceil(span.low)));
    const int high = std::min(patch_.u0 + patch_.width - 1, static_cast<int>(std::floor(span.high)));
    if (low > high) continue;
    const std::size_t first = static_cast<std::size_t>(row - patch_.v0) * patch_.width + (low - patch_.u0);
    fill_span(static_cast<float>(at_origin + per_u * low + per_v * row), static_cast<float>(per_u), high - low + 1,
              facing, index, &patch_.inverse_depth[first], &patch_.facing[first], &patch_.face[first]);
  }
}

}  // namespace dofusion
