#include "perception/face_graph.h"

#include <algorithm>
#include <map>

#include <Eigen/Dense>

namespace dofusion {
namespace {

// Neighbouring readings err together, so that a plane is less certain than independent readings would make it.
constexpr double kCorrelation = 3.0;

struct Border {
  int v = 0, u = 0;    // the last pixel of the first face
  int dv = 0, du = 0;  // unit step towards the second
  int gap = 1;         // pixels from the first face to the second
};

class EdgeFinder {
 public:
  EdgeFinder(const FaceMap& map, const DepthImage& depth, const Camera& camera, const FaceOptions& options)
      : map_(map), depth_(depth), camera_(camera), options_(options) {}

  void add(const Border& border) {
    const int first = map_.index.at(border.v, border.u);
    const int second = map_.index.at(border.v + border.gap * border.dv, border.u + border.gap * border.du);
    const InversePlane& p = map_.faces[first].plane;
    const InversePlane& q = map_.faces[second].plane;
    const Eigen::Vector3d ray =
        pixel_ray(camera_, border.u + 0.5 * border.gap * border.du, border.v + 0.5 * border.gap * border.dv);
    const double inverse = 0.5 * (p + q).dot(ray);
    if (inverse <= 0.0) return;
    FaceEdge& edge = edges_[std::minmax(first, second)];
    edge.length += 1;
    // Two planes that meet at the border differ there by no more than their slopes make of an inexact border.
    const double sigma = std::max(options_.sigma(1.0 / inverse), 1e-5) * inverse * inverse;
    const double inexact_px = 1.5 + 0.5 * border.gap;
    const double tolerance = 2.0 * sigma + inexact_px * (p - q).head<2>().norm() / camera_.fx;
    if (std::abs((p - q).dot(ray)) <= tolerance) edge.continuous += 1;
    // The surface of a convex body has the least inverse depth of its face planes.
    const Eigen::Vector2d step(border.du / camera_.fx, border.dv / camera_.fy);
    edge.convexity += (p - q).head<2>().dot(step);
    compare_readings(border, first, second, sigma, edge);
  }

  std::vector<FaceEdge> edges() const {
    std::vector<FaceEdge> list;
    for (const auto& [faces, summed] : edges_) {
      FaceEdge edge = summed;
      edge.a = faces.first;
      edge.b = faces.second;
      const double cosine = map_.faces[edge.a].normal().dot(map_.faces[edge.b].normal());
      edge.angle_deg = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / M_PI;
      edge.plane_step /= std::max(1, edge.compared);
      edge.reading_step /= std::max(1, edge.compared);
      list.push_back(edge);
    }
    return list;
  }

 private:
  // A little off the border, where noise did not decide which face a reading belongs to.
  void compare_readings(const Border& border, int first, int second, double sigma, FaceEdge& edge) {
    constexpr int kOff = 2;
    const int v = border.v - kOff * border.dv, u = border.u - kOff * border.du;
    const int y = border.v + (border.gap + kOff) * border.dv, x = border.u + (border.gap + kOff) * border.du;
    if (!depth_.contains(v, u) || !depth_.contains(y, x)) return;
    if (map_.index.at(v, u) != first || map_.index.at(y, x) != second) return;
    const InversePlane mean = 0.5 * (map_.faces[first].plane + map_.faces[second].plane);
    const InversePlane difference = map_.faces[second].plane - map_.faces[first].plane;
    const double before = 1.0 / depth_.at(v, u) - mean.dot(pixel_ray(camera_, u, v));
    const double after = 1.0 / depth_.at(y, x) - mean.dot(pixel_ray(camera_, x, y));
    const double sign = first < second ? 1.0 : -1.0;
    edge.compared += 1;
    edge.reading_step += sign * (after - before) / sigma;
    edge.plane_step += sign * difference.dot(pixel_ray(camera_, 0.5 * (u + x), 0.5 * (v + y))) / sigma;
  }

  const FaceMap& map_;
  const DepthImage& depth_;
  const Camera& camera_;
  const FaceOptions& options_;
  std::map<std::pair<int, int>, FaceEdge> edges_;
};

}  // namespace

std::vector<FaceEdge> find_face_edges(const FaceMap& map, const DepthImage& depth, const Camera& camera,
                                      const FaceOptions& options, int max_gap_px) {
  EdgeFinder finder(map, depth, camera, options);
  for (int v = 0; v < map.index.height; ++v) {
    for (int u = 0; u < map.index.width; ++u) {
      const int face = map.index.at(v, u);
      if (face == kNoFace) continue;
      for (const auto& [dv, du] : {std::pair{0, 1}, {1, 0}}) {
        for (int k = 1; k <= max_gap_px && map.index.contains(v + k * dv, u + k * du); ++k) {
          const int other = map.index.at(v + k * dv, u + k * du);
          if (other == kNoFace) continue;
          if (other != face) finder.add({v, u, dv, du, k});
          break;
        }
      }
    }
  }
  return finder.edges();
}

bool is_bend(const FaceMap& map, int f, int g, const DepthImage& depth, const Camera& camera,
             const FaceOptions& options) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6 b = Vector6::Zero();
  double total = 0.0, planes = 0.0;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  std::vector<std::pair<int, int>> pixels;
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      if (map.index.at(v, u) != f && map.index.at(v, u) != g) continue;
      pixels.emplace_back(v, u);
      centre += pixel_ray(camera, u, v).head<2>();
    }
  }
  if (pixels.size() < 12) return false;
  centre /= static_cast<double>(pixels.size());
  for (const auto& [v, u] : pixels) {
    const InversePlane& plane = map.faces[map.index.at(v, u)].plane;
    const Eigen::Vector3d ray = pixel_ray(camera, u, v);
    const double inverse = 1.0 / depth.at(v, u);
    const double sigma = inverse_sigma(depth.at(v, u), plane, camera, options);
    const double weight = 1.0 / (sigma * sigma);
    const Eigen::Vector2d q = 10.0 * (ray.head<2>() - centre);  // of order one
    const double off = inverse - plane.dot(ray);
    const Vector6 basis = (Vector6() << 1.0, q.x(), q.y(), q.x() * q.x(), q.x() * q.y(), q.y() * q.y()).finished();
    A += weight * basis * basis.transpose();
    b += weight * inverse * basis;
    total += weight * inverse * inverse;
    planes += weight * off * off;
  }
  const Vector6 surface = A.ldlt().solve(b);
  return surface.allFinite() && total - surface.dot(b) < planes;
}

std::vector<std::vector<FaceRelation>> relate_faces(const FaceMap& map, const DepthImage& depth, const Camera& camera,
                                                    const FaceOptions& options) {
  constexpr double kInFront = 4.0;  // standard deviations
  const std::size_t count = map.faces.size();
  std::vector<std::vector<FaceRelation>> relation(count, std::vector<FaceRelation>(count));
  std::vector<int> samples(count, 0);
  for (int v = 0; v < depth.height; v += 2) {
    for (int u = v / 2 % 2; u < depth.width; u += 2) {
      const int g = map.index.at(v, u);
      if (g == kNoFace) continue;
      ++samples[g];
      const double inverse = 1.0 / depth.at(v, u);
      const Eigen::Vector3d ray = pixel_ray(camera, u, v);
      for (std::size_t f = 0; f < count; ++f) {
        const Face& face = map.faces[f];
        const double sigma = inverse_sigma(1.0 / inverse, face.plane, camera, options);
        const double blur = kCorrelation * std::sqrt(std::max(0.0, ray.dot(face.covariance * ray)));
        const double e = (inverse - face.plane.dot(ray)) / std::hypot(sigma, blur);
        FaceRelation& r = relation[f][g];
        r.in_front += e > kInFront ? 1.0 : 0.0;
        r.rms += e * e;
        r.blur += blur / sigma;
      }
    }
  }
  for (auto& row : relation) {
    for (std::size_t g = 0; g < count; ++g) {
      const double n = std::max(samples[g], 1);
      row[g] = {row[g].in_front / n, std::sqrt(row[g].rms / n), row[g].blur / n};
    }
  }
  return relation;
}

}  // namespace dofusion
