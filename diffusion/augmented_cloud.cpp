#include "diffusion/augmented_cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dofusion {
namespace {

// A float in [0, 1) of the upper bits of one draw; clouds take hundreds a scene.
float quick_uniform(std::uint32_t bits) { return static_cast<float>(bits >> 8) * (1.0f / 16777216.0f); }

// Where another distance is smaller, it and its direction replace the ones so far.
void keep_nearer(int count, const float* other, const Columns& other_direction, float* distance,
                 const Columns& direction) {
  for (int i = 0; i < count; ++i) {
    const bool nearer = other[i] < distance[i];
    distance[i] = nearer ? other[i] : distance[i];
    for (int d = 0; d < 3; ++d) direction[d][i] = nearer ? other_direction[d][i] : direction[d][i];
  }
}

// Of each column i: out = R in + t.
void transform(const Eigen::Matrix3f& R, const Eigen::Vector3f& t, int count, const ConstColumns& in,
               const Columns& out) {
  for (int d = 0; d < 3; ++d)
    for (int i = 0; i < count; ++i) out[d][i] = R(d, 0) * in[0][i] + R(d, 1) * in[1][i] + R(d, 2) * in[2][i] + t[d];
}

ConstColumns readable(const Columns& columns) { return {columns[0], columns[1], columns[2]}; }

// Points on each object.
std::vector<int> share_out(int points, int query_points, int objects, int query) {
  const int others = objects - 1;
  const int share = others == 0 ? 0 : query_points > 0 ? (points - query_points) / others : points / objects;
  std::vector<int> shares(static_cast<std::size_t>(objects), share);
  shares[static_cast<std::size_t>(query)] = points - share * others;
  if (others > 0 && share < 1)
    throw std::invalid_argument("an augmented cloud needs at least one point for every object");
  return shares;
}

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
    field_ = [grid = object.sdf](const Eigen::Vector3d& p) { return (*grid)(p); };
  } else if (object.convex) {
    parts_ = {prepare(object.mesh)};
  } else if (!object.parts.empty()) {
    for (const TriangleMesh& part : object.parts) parts_.push_back(prepare(part));
  } else {
    field_ = MeshDistance(object.mesh);
  }
  set_surface(object.mesh);
}

CloudShape::CloudShape(const TriangleMesh& mesh, const std::optional<Eigen::Vector3d>& box_edges) {
  if (box_edges) half_edges_ = (*box_edges / 2).cast<float>();
  parts_ = {prepare(mesh)};
  set_surface(mesh);
}

CloudShape::Triangles CloudShape::prepare(const TriangleMesh& mesh) {
  Triangles triangles;
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
    triangles.push_back(t);
  }
  if (triangles.empty()) throw std::invalid_argument("a shape needs triangles with an area");
  return triangles;
}

void CloudShape::set_surface(const TriangleMesh& mesh) {
  volume_ = dofusion::volume(mesh);
  surface_ = prepare(mesh);
  float area = 0.0f;
  for (const Triangle& t : surface_) {
    area += 0.5f * t.ab.cross(t.ac).norm();
    cumulative_area_.push_back(area);
  }
  sharp_ = sharp_features(mesh);
  float length = 0.0f;
  for (const SharpFeatures::Edge& edge : sharp_.edges) {
    length += static_cast<float>((edge.to - edge.from).norm());
    cumulative_length_.push_back(length);
  }
}

Eigen::Vector3f CloudShape::surface_point(Rng& rng, Eigen::Vector3f& normal) const {
  const std::uint64_t first = rng(), second = rng();
  const float pick = quick_uniform(static_cast<std::uint32_t>(second)) * cumulative_area_.back();
  const auto found = std::upper_bound(cumulative_area_.begin(), cumulative_area_.end() - 1, pick);
  float u = quick_uniform(static_cast<std::uint32_t>(first >> 32));
  float v = quick_uniform(static_cast<std::uint32_t>(first));
  if (u + v > 1) {
    u = 1 - u;
    v = 1 - v;
  }
  const Triangle& triangle = surface_[static_cast<std::size_t>(found - cumulative_area_.begin())];
  normal = triangle.normal;
  return triangle.a + u * triangle.ab + v * triangle.ac;
}

Eigen::Vector3f CloudShape::edge_point(Rng& rng) const {
  const std::uint64_t bits = rng();
  const float pick = quick_uniform(static_cast<std::uint32_t>(bits >> 32)) * cumulative_length_.back();
  const auto found = std::upper_bound(cumulative_length_.begin(), cumulative_length_.end() - 1, pick);
  const SharpFeatures::Edge& edge = sharp_.edges[static_cast<std::size_t>(found - cumulative_length_.begin())];
  const float along = quick_uniform(static_cast<std::uint32_t>(bits));
  return (edge.from + along * (edge.to - edge.from)).cast<float>();
}

void CloudShape::sample(int count, double sharp, Rng& rng, const Columns& point, const Columns& normal) const {
  const auto put = [&](int i, const Eigen::Vector3f& p, const Eigen::Vector3f& n) {
    for (int d = 0; d < 3; ++d) {
      point[d][i] = p[d];
      normal[d][i] = n[d];
    }
  };
  const int on_edges = sharp_.edges.empty() ? 0 : static_cast<int>(std::lround(sharp * count));
  const int corners = static_cast<int>(sharp_.corners.size());
  for (int i = 0; i < on_edges; ++i) {
    const bool corner = i < corners;
    const int which = corners <= on_edges || !corner ? i : uniform_int(rng, 0, corners - 1);
    put(i, corner ? sharp_.corners[static_cast<std::size_t>(which)].cast<float>().eval() : edge_point(rng),
        Eigen::Vector3f::Zero());
  }
  for (int i = on_edges; i < count; ++i) {
    Eigen::Vector3f n;
    const Eigen::Vector3f p = surface_point(rng, n);
    put(i, p, n);
  }
}

void CloudShape::signed_distance(int count, const ConstColumns& point, float* distance,
                                 const Columns& direction) const {
  if (half_edges_) return box_distance(count, point, distance, direction);
  if (field_) return field_distance(count, point, distance, direction);
  convex_distance(parts_[0], count, point, distance, direction);
  if (parts_.size() == 1) return;
  std::vector<float> buffer(static_cast<std::size_t>(count) * 4);
  float* other = buffer.data();
  const Columns other_direction{other + count, other + 2 * count, other + 3 * count};
  for (std::size_t part = 1; part < parts_.size(); ++part) {
    convex_distance(parts_[part], count, point, other, other_direction);
    keep_nearer(count, other, other_direction, distance, direction);
  }
}

void CloudShape::box_distance(int count, const ConstColumns& point, float* distance, const Columns& direction) const {
  const Eigen::Vector3f h = *half_edges_;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3f p(point[0][i], point[1][i], point[2][i]);
    const Eigen::Vector3f beyond = p.cwiseAbs() - h, outside = beyond.cwiseMax(0.0f);
    int axis = 0;
    const float deepest = beyond.maxCoeff(&axis);
    const float length = outside.norm();
    distance[i] = deepest > 0.0f ? length : deepest;
    for (int d = 0; d < 3; ++d) {
      const float along = deepest > 0.0f ? outside[d] / length : d == axis ? 1.0f : 0.0f;
      direction[d][i] = p[d] < 0.0f ? -along : along;
    }
  }
}

void CloudShape::field_distance(int count, const ConstColumns& point, float* distance, const Columns& direction) const {
  const double step = 1e-3 * std::cbrt(std::abs(volume_));
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d p(point[0][i], point[1][i], point[2][i]);
    Eigen::Vector3d gradient;
    for (int d = 0; d < 3; ++d)
      gradient[d] = field_(p + step * Eigen::Vector3d::Unit(d)) - field_(p - step * Eigen::Vector3d::Unit(d));
    gradient.normalize();
    distance[i] = static_cast<float>(field_(p));
    for (int d = 0; d < 3; ++d) direction[d][i] = static_cast<float>(gradient[d]);
  }
}

// Inside, the distance is the largest of the planes'; outside, the smallest of the triangles'. Point by point in
// blocks, so that the compiler can take many points at once.
void CloudShape::convex_distance(const Triangles& triangles, int count, const ConstColumns& point, float* distance,
                                 const Columns& direction) {
  constexpr int kBlock = 64;
  for (int start = 0; start < count; start += kBlock) {
    const int n = std::min(kBlock, count - start);
    const float *x = point[0] + start, *y = point[1] + start, *z = point[2] + start;
    float plane[kBlock], square[kBlock];  // height over the highest plane, squared distance to the nearest triangle
    float nx[kBlock], ny[kBlock], nz[kBlock];  // that plane's normal
    float rx[kBlock], ry[kBlock], rz[kBlock];  // from that triangle's nearest point
    std::fill_n(plane, kBlock, -1e30f);
    std::fill_n(square, kBlock, 1e30f);
    for (const Triangle& t : triangles) {
      for (int i = 0; i < n; ++i) {
        const float height =
            t.normal.x() * (x[i] - t.a.x()) + t.normal.y() * (y[i] - t.a.y()) + t.normal.z() * (z[i] - t.a.z());
        const bool higher = height > plane[i];
        plane[i] = higher ? height : plane[i];
        nx[i] = higher ? t.normal.x() : nx[i];
        ny[i] = higher ? t.normal.y() : ny[i];
        nz[i] = higher ? t.normal.z() : nz[i];
        float outside = -1e30f, nearest = 1e30f, ex = 0.0f, ey = 0.0f, ez = 0.0f;
        for (int e = 0; e < 3; ++e) {
          const Eigen::Vector3f &s = t.edge_start[e], &d = t.edge[e], &o = t.side[e];
          const float qx = x[i] - s.x(), qy = y[i] - s.y(), qz = z[i] - s.z();
          outside = std::max(outside, o.x() * qx + o.y() * qy + o.z() * qz);
          float along = (d.x() * qx + d.y() * qy + d.z() * qz) * t.edge_inverse_square[e];
          along = std::min(std::max(along, 0.0f), 1.0f);
          const float fx = qx - along * d.x(), fy = qy - along * d.y(), fz = qz - along * d.z();
          const float f2 = fx * fx + fy * fy + fz * fz;
          const bool nearer = f2 < nearest;
          nearest = nearer ? f2 : nearest;
          ex = nearer ? fx : ex;
          ey = nearer ? fy : ey;
          ez = nearer ? fz : ez;
        }
        const bool over = outside <= 0.0f;
        const float candidate = over ? height * height : nearest;
        const bool nearer = candidate < square[i];
        square[i] = nearer ? candidate : square[i];
        rx[i] = nearer ? (over ? height * t.normal.x() : ex) : rx[i];
        ry[i] = nearer ? (over ? height * t.normal.y() : ey) : ry[i];
        rz[i] = nearer ? (over ? height * t.normal.z() : ez) : rz[i];
      }
    }
    for (int i = 0; i < n; ++i) {
      const float length = std::sqrt(square[i]);
      const bool inside = plane[i] <= 0.0f || length < 1e-9f;
      const float factor = inside ? 0.0f : 1.0f / length;
      distance[start + i] = inside ? plane[i] : length;
      direction[0][start + i] = inside ? nx[i] : factor * rx[i];
      direction[1][start + i] = inside ? ny[i] : factor * ry[i];
      direction[2][start + i] = inside ? nz[i] : factor * rz[i];
    }
  }
}

void make_augmented_cloud(const std::vector<CloudShapePtr>& shapes, const std::vector<Pose>& T_world_object, int query,
                          const CloudOptions& options, Rng& rng, float* cloud) {
  const int objects = static_cast<int>(shapes.size());
  if (objects == 0 || T_world_object.size() != shapes.size() || query < 0 || query >= objects)
    throw std::invalid_argument("an augmented cloud needs a query and a pose for every object");
  const std::vector<int> shares = share_out(options.points, options.query_points, objects, query);
  const int most = *std::max_element(shares.begin(), shares.end());
  std::vector<float> buffer(static_cast<std::size_t>(most) * 23);
  float* next = buffer.data();
  const auto columns = [&] {
    const Columns result{next, next + most, next + 2 * most};
    next += 3 * most;
    return result;
  };
  const Columns local = columns(), local_normal = columns(), world = columns(), normal = columns(),
                in_other = columns(), in_other_direction = columns(), direction = columns();
  float *const distance = next, *const other_distance = next + most;

  const float scale = static_cast<float>(1.0 / options.length);
  const float limit = static_cast<float>(options.distance_limit);
  float* out = cloud;
  for (int i = 0; i < objects; ++i) {
    const int n = shares[static_cast<std::size_t>(i)];
    const Pose& T_world_i = T_world_object[static_cast<std::size_t>(i)];
    const Eigen::Matrix3f R = T_world_i.linear().cast<float>();
    shapes[static_cast<std::size_t>(i)]->sample(n, options.sharp_share, rng, local, local_normal);
    transform(R, (T_world_i.translation() - options.origin).cast<float>(), n, readable(local), world);
    transform(R, Eigen::Vector3f::Zero(), n, readable(local_normal), normal);
    std::fill_n(distance, n, std::numeric_limits<float>::max());
    for (float* column : direction) std::fill_n(column, n, 0.0f);
    for (int j = 0; j < objects; ++j) {
      if (j == i) continue;
      const Pose& T_world_j = T_world_object[static_cast<std::size_t>(j)];
      const Eigen::Matrix3d R_j_world = T_world_j.linear().transpose();
      transform((R_j_world * T_world_i.linear()).cast<float>(),
                (R_j_world * (T_world_i.translation() - T_world_j.translation())).cast<float>(), n, readable(local),
                in_other);
      shapes[static_cast<std::size_t>(j)]->signed_distance(n, readable(in_other), other_distance, in_other_direction);
      transform(T_world_j.linear().cast<float>(), Eigen::Vector3f::Zero(), n, readable(in_other_direction), in_other);
      keep_nearer(n, other_distance, in_other, distance, direction);
    }
    for (int p = 0; p < n; ++p, out += kCloudChannels) {
      for (int d = 0; d < 3; ++d) out[d] = world[d][p] * scale;
      out[3] = std::min(std::max(distance[p] * scale, -limit), limit);
      out[4] = i == query ? 1.0f : 0.0f;
      for (int d = 0; d < 3; ++d) {
        out[5 + d] = normal[d][p];
        out[8 + d] = direction[d][p];
      }
    }
  }
}

}  // namespace dofusion
