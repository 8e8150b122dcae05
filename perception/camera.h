// The pinhole camera. OpenCV's frame: x right, y down, z forward; pixel centres at integer coordinates.
#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "stability/pose.h"

namespace dofusion {

struct Camera {
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;  // pixels
  int width = 0, height = 0;                      // pixels
  double depth_scale = 1.0;                       // value in a depth image × depth_scale = millimetres
};

// The point at z-depth `depth` (metres) seen at pixel (u, v), in the camera's frame.
inline Eigen::Vector3d unproject(const Camera& camera, double u, double v, double depth) {
  return {(u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth, depth};
}

// Pixel coordinates (u, v) of a point in the camera's frame; its z must be positive.
inline Eigen::Vector2d project(const Camera& camera, const Eigen::Vector3d& p) {
  return {camera.fx * p.x() / p.z() + camera.cx, camera.fy * p.y() / p.z() + camera.cy};
}

// A camera with square pixels whose image is `fovy` radians high (SceneCamera::fovy), the principal point in its
// middle. Throws std::invalid_argument unless the angle lies between 0 and pi and the size is positive.
Camera camera_of_fovy(double fovy, int width, int height);

// T_world_camera of a camera at `eye` that looks at `target` with the image's up along world z (both in metres;
// throws std::invalid_argument if they coincide or the view is along z).
Pose look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

// BOP's camera.json: fx, fy, cx, cy, width, height, depth_scale. Throws InputError naming the file and the field
// that is missing or wrong: focal lengths, sizes and depth_scale are positive, an image has 100 million pixels at most.
Camera read_camera(const std::string& path);
void write_camera(const Camera& camera, const std::string& path);

}  // namespace dofusion
