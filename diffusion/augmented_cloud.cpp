#include "diffusion/augmented_cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dofusion {
namespace {

// A float in [0, 1) of the upper bits of one draw; clouds take hundreds a scene.
float quick_uniform(std::uint32_t bits) { return static_cast<float>(bits >> 8) * (1.0f / 16777216.0f); }

}  // namespace

double normalised_length(const std::vector<double>& volumes) {
  if (volumes.empty()) throw std::invalid_argument("a scene without objects has no normalised length");
  double sum = 0.0;
  for (const double volume : volumes) {
    if (!(volume > 0)) throw std::invalid_argument("an object's volume must be positive");
    sum += std::log(volume);
  }
  return std::exp(sum / (3.0 * static_cast<double>(volumes.size())));
}

CloudShape::CloudShape(const Object& object) {
  if (object.box_edges) half_edges_ = (*object.box_edges / 2).cast<float>();
  if (object.sdf) {
    distance_ = [grid = object.sdf](const Eigen::Vector3d& p) { return (*grid)(p); };
  } else if (!object.convex) {
    distance_ = MeshDistance(object.mesh);
  }
  prepare(object.mesh);
}

CloudShape::CloudShape(const TriangleMesh& mesh, const std::optional<Eigen::Vector3d>& box_edges) {
  if (box_edges) half_edges_ = (*box_edges / 2).cast<float>();
  prepare(mesh);
}

void CloudShape::prepare(const TriangleMesh& mesh) {
  volume_ = dofusion::volume(mesh);
  float area = 0.0f;
  for (const Eigen::Vector3i& corner : mesh.triangles) {
    const Eigen::Vector3d p[3] = {mesh.vertices[corner[0]], mesh.vertices[corner[1]], mesh.vertices[corner[2]]};
    const Eigen::Vector3d normal = (p[1] - p[0]).cross(p[2] - p[0]);
    if (!(normal.norm() > 0)) continue;
    Triangle t;
    t.a = p[0].cast<float>();
    t.ab = (p[1] - p[0]).cast<float>();
    t.ac = (p[2] - p[0]).cast<float>();
    t.normal = normal.normalized().cast<float>();
    for (int e = 0; e < 3; ++e) {
      const Eigen::Vector3d edge = p[(e + 1) % 3] - p[e];
      t.edge_start[e] = p[e].cast<float>();
      t.edge[e] = edge.cast<float>();
      t.side[e] = edge.cross(normal).normalized().cast<float>();
      t.edge_inverse_square[e] = static_cast<float>(1.0 / edge.squaredNorm());
    }
    area += static_cast<float>(normal.norm() / 2);
    triangles_.push_back(t);
    cumulative_area_.push_back(area);
  }
  if (triangles_.empty()) throw std::invalid_argument("a shape needs triangles with an area");
}

void CloudShape::sample(int count, Rng& rng, float* x, float* y, float* z) const {
  const float total = cumulative_area_.back();
  for (int i = 0; i < count; ++i) {
    const std::uint64_t first = rng(), second = rng();
    const float pick = quick_uniform(static_cast<std::uint32_t>(second)) * total;
    std::size_t t = 0;
    while (t + 1 < cumulative_area_.size() && cumulative_area_[t] <= pick) ++t;
    float u = quick_uniform(static_cast<std::uint32_t>(first >> 32));
    float v = quick_uniform(static_cast<std::uint32_t>(first));
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const Triangle& triangle = triangles_[t];
    const Eigen::Vector3f p = triangle.a + u * triangle.ab + v * triangle.ac;
    x[i] = p.x();
    y[i] = p.y();
    z[i] = p.z();
  }
}

void CloudShape::min_distance(int count, const float* x, const float* y, const float* z, float* out) const {
  if (half_edges_) {
    const Eigen::Vector3f h = *half_edges_;
    for (int i = 0; i < count; ++i) {
      const float dx = std::abs(x[i]) - h.x(), dy = std::abs(y[i]) - h.y(), dz = std::abs(z[i]) - h.z();
      const float ox = std::max(dx, 0.0f), oy = std::max(dy, 0.0f), oz = std::max(dz, 0.0f);
      const float inside = std::min(std::max(dx, std::max(dy, dz)), 0.0f);
      out[i] = std::min(out[i], std::sqrt(ox * ox + oy * oy + oz * oz) + inside);
    }
    return;
  }
  if (distance_) {
    for (int i = 0; i < count; ++i)
      out[i] = std::min(out[i], static_cast<float>(distance_(Eigen::Vector3d(x[i], y[i], z[i]))));
    return;
  }
  // Convex: inside, the distance is the largest of the planes'; outside, the smallest of the triangles'. Point by
  // point in blocks, so that the compiler can take many points at once.
  constexpr int kBlock = 64;
  for (int start = 0; start < count; start += kBlock) {
    const int n = std::min(kBlock, count - start);
    float plane[kBlock], square[kBlock];
    std::fill_n(plane, kBlock, -1e30f);
    std::fill_n(square, kBlock, 1e30f);
    for (const Triangle& t : triangles_) {
      for (int i = 0; i < n; ++i) {
        const float px = x[start + i], py = y[start + i], pz = z[start + i];
        const float height =
            t.normal.x() * (px - t.a.x()) + t.normal.y() * (py - t.a.y()) + t.normal.z() * (pz - t.a.z());
        plane[i] = std::max(plane[i], height);
        float outside = -1e30f, nearest = 1e30f;
        for (int e = 0; e < 3; ++e) {
          const Eigen::Vector3f &s = t.edge_start[e], &d = t.edge[e], &o = t.side[e];
          const float qx = px - s.x(), qy = py - s.y(), qz = pz - s.z();
          outside = std::max(outside, o.x() * qx + o.y() * qy + o.z() * qz);
          float along = (d.x() * qx + d.y() * qy + d.z() * qz) * t.edge_inverse_square[e];
          along = std::min(std::max(along, 0.0f), 1.0f);
          const float rx = qx - along * d.x(), ry = qy - along * d.y(), rz = qz - along * d.z();
          nearest = std::min(nearest, rx * rx + ry * ry + rz * rz);
        }
        square[i] = std::min(square[i], outside <= 0 ? height * height : nearest);
      }
    }
    for (int i = 0; i < n; ++i) {
      const float distance = plane[i] <= 0 ? plane[i] : std::sqrt(square[i]);
      out[start + i] = std::min(out[start + i], distance);
    }
  }
}

void make_augmented_cloud(const std::vector<CloudShapePtr>& shapes, const std::vector<Pose>& T_world_object, int query,
                          const CloudOptions& options, Rng& rng, float* cloud) {
  const int count = static_cast<int>(shapes.size());
  if (count == 0 || T_world_object.size() != shapes.size() || query < 0 || query >= count || options.points < count)
    throw std::invalid_argument("an augmented cloud needs a pose and at least one point for every object");
  const int share = options.points / count;
  std::vector<float> buffer(static_cast<std::size_t>(options.points) * 10);
  const auto column = [&](int c) { return buffer.data() + static_cast<std::size_t>(options.points) * c; };
  float *local[3] = {column(0), column(1), column(2)}, *world[3] = {column(3), column(4), column(5)};
  float *other[3] = {column(6), column(7), column(8)}, *distance = column(9);
  std::fill_n(distance, options.points, std::numeric_limits<float>::max());

  const float scale = static_cast<float>(1.0 / options.length);
  const float limit = static_cast<float>(options.distance_limit);
  int start = 0;
  for (int i = 0; i < count; ++i) {
    const int n = i == query ? options.points - share * (count - 1) : share;
    const Eigen::Matrix3f R = T_world_object[i].linear().cast<float>();
    const Eigen::Vector3f t = (T_world_object[i].translation() - options.origin).cast<float>();
    shapes[i]->sample(n, rng, local[0], local[1], local[2]);
    for (int d = 0; d < 3; ++d)
      for (int p = 0; p < n; ++p)
        world[d][p] = R(d, 0) * local[0][p] + R(d, 1) * local[1][p] + R(d, 2) * local[2][p] + t[d];
    for (int j = 0; j < count; ++j) {
      if (j == i) continue;
      const Eigen::Matrix3f R_j_i = (T_world_object[j].linear().transpose() * T_world_object[i].linear()).cast<float>();
      const Eigen::Vector3f t_j_i =
          (T_world_object[j].linear().transpose() * (T_world_object[i].translation() - T_world_object[j].translation()))
              .cast<float>();
      for (int d = 0; d < 3; ++d)
        for (int p = 0; p < n; ++p)
          other[d][p] = R_j_i(d, 0) * local[0][p] + R_j_i(d, 1) * local[1][p] + R_j_i(d, 2) * local[2][p] + t_j_i[d];
      shapes[j]->min_distance(n, other[0], other[1], other[2], distance + start);
    }
    float* out = cloud + static_cast<std::size_t>(start) * 5;
    for (int p = 0; p < n; ++p, out += 5) {
      for (int d = 0; d < 3; ++d) out[d] = world[d][p] * scale;
      out[3] = std::min(std::max(distance[start + p] * scale, -limit), limit);
      out[4] = i == query ? 1.0f : 0.0f;
    }
    start += n;
  }
}

}  // namespace dofusion
