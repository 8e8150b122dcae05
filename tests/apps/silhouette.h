// A renderer of depth images that shares nothing with the project's.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Dense>

#include "tests/apps/bop_files.h"

namespace dofusion::bop {

inline constexpr double kFar = std::numeric_limits<double>::infinity();

struct View {
  Eigen::Matrix3d K;
  int width = 0, height = 0;
};

// z-depth in mm of a model over the image and one image's size around it on each side: BOP's silhouettes go on there.
class Silhouette {
 public:
  Silhouette(const Model& model, const Eigen::Matrix3d& R, const Eigen::Vector3d& t, const View& view)
      : view_(view), depth_(static_cast<std::size_t>(9 * view.width * view.height), kFar) {
    for (const auto& i : model.triangles) {
      draw(R * model.vertices[i[0]] + t, R * model.vertices[i[1]] + t, R * model.vertices[i[2]] + t);
    }
  }
  // u in [-width, 2 width), v in [-height, 2 height)
  double& at(int u, int v) {
    return depth_[static_cast<std::size_t>((v + view_.height) * 3 * view_.width + u + view_.width)];
  }

 private:
  void draw(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
    const Eigen::Vector3d n = (b - a).cross(c - a);
    Eigen::Vector2d low(kFar, kFar), high(-kFar, -kFar);
    for (const Eigen::Vector3d& p : {a, b, c}) {
      const Eigen::Vector2d pixel = (view_.K * p).hnormalized();
      low = low.cwiseMin(pixel);
      high = high.cwiseMax(pixel);
    }
    const int u0 = std::max(-view_.width, static_cast<int>(std::ceil(low.x())));
    const int u1 = std::min(2 * view_.width - 1, static_cast<int>(std::floor(high.x())));
    const int v0 = std::max(-view_.height, static_cast<int>(std::ceil(low.y())));
    const int v1 = std::min(2 * view_.height - 1, static_cast<int>(std::floor(high.y())));
    const Eigen::Matrix3d K_inverse = view_.K.inverse();
    for (int v = v0; v <= v1; ++v) {
      for (int u = u0; u <= u1; ++u) {
        const Eigen::Vector3d ray = K_inverse * Eigen::Vector3d(u, v, 1.0);  // to depth 1
        const double s0 = ray.dot(a.cross(b)), s1 = ray.dot(b.cross(c)), s2 = ray.dot(c.cross(a));
        const bool hit = (s0 <= 0.0 && s1 <= 0.0 && s2 <= 0.0) || (s0 >= 0.0 && s1 >= 0.0 && s2 >= 0.0);
        if (!hit || n.dot(ray) == 0.0) continue;
        double& z = at(u, v);
        z = std::min(z, n.dot(a) / n.dot(ray));
      }
    }
  }

  View view_;
  std::vector<double> depth_;
};

}  // namespace dofusion::bop
