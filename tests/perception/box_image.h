// Depth images of boxes on a table, by ray casting without any library: fixtures for the recovery tests.
#pragma once

#include <cmath>
#include <vector>

#include "perception/convex_body.h"
#include "perception/image.h"
#include "perception/table.h"
#include "stability/random.h"
#include "stability/scene.h"
#include "stability/shapes.h"

namespace dofusion {

inline Camera test_camera() { return {525.0, 525.0, 159.5, 119.5, 320, 240, 1.0}; }

// A box with a corner-to-corner turn about the vertical, its centre at `centre`.
inline TriangleMesh upright_box(const Eigen::Vector3d& edges, const Eigen::Vector3d& centre, double yaw) {
  TriangleMesh mesh = box_mesh(edges);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  for (Eigen::Vector3d& v : mesh.vertices) v = R * v + centre;
  return mesh;
}

struct BoxImage {
  DepthImage depth;
  LabelImage labels;
};

// The table z = 0 and convex meshes on it, with Gaussian noise of sigma(z).
inline BoxImage render_boxes(const std::vector<TriangleMesh>& meshes, const Camera& camera, const Pose& T_world_camera,
                             const DepthSigma& sigma, std::uint64_t seed) {
  BoxImage image{DepthImage(camera.width, camera.height), LabelImage(camera.width, camera.height)};
  std::vector<std::vector<HalfSpace>> bodies;
  for (const TriangleMesh& mesh : meshes) bodies.push_back(half_spaces(mesh));
  Rng rng = make_rng(seed);
  const Eigen::Vector3d eye = T_world_camera.translation();
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d direction = T_world_camera.linear() * pixel_ray(camera, u, v);
      double nearest = direction.z() < 0.0 ? -eye.z() / direction.z() : 0.0;
      if (nearest > 0.0) image.labels.at(v, u) = kLabelTable;
      for (std::size_t i = 0; i < bodies.size(); ++i) {
        const std::optional<double> z = enter(bodies[i], eye, direction);
        if (!z || (nearest > 0.0 && *z > nearest)) continue;
        nearest = *z;
        image.labels.at(v, u) = static_cast<std::uint8_t>(kLabelFirstObject + i);
      }
      if (nearest > 0.0) image.depth.at(v, u) = static_cast<float>(nearest + normal(rng, sigma(nearest)));
    }
  }
  return image;
}

}  // namespace dofusion
