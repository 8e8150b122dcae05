#include "perception/synthetic_view.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Dense>

namespace dofusion {

namespace {
constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180.0;

}  // namespace

Camera default_camera() { return {600.0, 600.0, 319.5, 239.5, 640, 480, 0.1}; }

Pose sample_viewpoint(const Eigen::Vector3d& target, const ViewpointOptions& options, Rng& rng) {
  if (!(options.distance > 0.0) || !(options.min_elevation_deg >= 0.0) ||
      !(options.min_elevation_deg <= options.max_elevation_deg) || !(options.max_elevation_deg < 90.0))
    throw std::invalid_argument("a viewpoint needs a positive distance and 0 <= min_elevation <= max_elevation < 90");
  // The area of a zone of the sphere is proportional to its height.
  const double height =
      uniform(rng, std::sin(options.min_elevation_deg * kDegree), std::sin(options.max_elevation_deg * kDegree));
  const double azimuth = uniform(rng, -kPi, kPi);
  const double radius = std::sqrt(1.0 - height * height);
  const Eigen::Vector3d direction(radius * std::cos(azimuth), radius * std::sin(azimuth), height);
  return look_at(target + options.distance * direction, target);
}

Eigen::Vector3d scene_centre(const Scene& scene) {
  TriangleMesh all;
  for (std::size_t i = 0; i < scene.objects.size(); ++i)
    for (const Eigen::Vector3d& vertex : scene.objects[i]->mesh.vertices)
      all.vertices.push_back(scene.T_world_object[i] * vertex);
  if (all.vertices.empty()) return Eigen::Vector3d::Zero();
  const BoundingBox box = bounding_box(all);
  return 0.5 * (box.min + box.max);
}

double viewing_distance(const Scene& scene, const Camera& camera) {
  constexpr double kShare = 0.75;
  const Eigen::Vector3d centre = scene_centre(scene);
  double radius = 0.0;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    for (const Eigen::Vector3d& vertex : scene.objects[i]->mesh.vertices) {
      radius = std::max(radius, (scene.T_world_object[i] * vertex - centre).norm());
    }
  }
  if (!(radius > 0.0)) throw std::invalid_argument("there is no object to look at");
  const double half_side = std::min(0.5 * camera.width / camera.fx, 0.5 * camera.height / camera.fy);  // at depth 1
  return radius / std::sin(std::atan(kShare * half_side));
}

SyntheticView make_synthetic_view(const Scene& scene, const Camera& camera, const SyntheticViewOptions& options,
                                  Rng& rng) {
  Scanner scanner(scene.objects);
  scanner.set_poses(scene.T_world_object);
  const Pose T_world_camera = sample_viewpoint(scene_centre(scene), options.viewpoint, rng);
  return make_synthetic_view(scanner.render(camera, T_world_camera), camera, T_world_camera, options, rng);
}

SyntheticView make_synthetic_view(Scan truth, const Camera& camera, const Pose& T_world_camera,
                                  const SyntheticViewOptions& options, Rng& rng) {
  SyntheticView view;
  view.T_world_camera = T_world_camera;
  view.truth = std::move(truth);
  view.depth = apply_sensor_noise(view.truth, camera, options.sensor, options.noise_scale, rng);
  if (options.miscalibration.any()) {  // drawn last, so that the image is the same with and without
    view.believed = miscalibrated({camera, T_world_camera}, options.miscalibration, options.noise_scale, rng);
  }
  return view;
}

std::string viewpoint_problem(const Scene& scene, const Pose& T_world_camera) {
  const Eigen::Vector3d eye = T_world_camera.translation();
  if (!(eye.z() > 0.0)) return "the camera is under the table";
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    if (encloses(scene.objects[i]->mesh, scene.T_world_object[i].inverse() * eye))
      return "the camera is inside object " + std::to_string(i) + " (" + scene.objects[i]->name + ")";
  }
  return "";
}

bool encloses(const TriangleMesh& mesh, const Eigen::Vector3d& point) {
  if (mesh.triangles.empty()) return false;
  const BoundingBox box = bounding_box(mesh);
  if ((point.array() < box.min.array()).any() || (point.array() > box.max.array()).any()) return false;
  double angle = 0.0;  // 4 pi in all for a point inside (Van Oosterom and Strackee 1983)
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]] - point, b = mesh.vertices[t[1]] - point,
                          c = mesh.vertices[t[2]] - point;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    angle += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return std::abs(angle) > 2.0 * kPi;
}

}  // namespace dofusion
