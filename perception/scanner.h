// Renders depth scans of scenes by ray casting (Embree).
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "perception/camera.h"
#include "perception/image.h"
#include "stability/scene.h"

namespace dofusion {

struct Scan {
  DepthImage depth;     // z-depth, metres, exact; 0 where nothing is hit
  LabelImage labels;    // 0 nothing, 1 table, 2 + i object i of the scanner
  NormalImage normals;  // outward unit normals in the camera's frame; zero where nothing is hit
};

struct ScannerOptions {
  bool table = true;             // the plane z = 0 is there
  double table_half_size = 2.0;  // metres; the table ends there
  int threads = 1;               // of `render`; the images do not depend on it
};

// One Embree scene with an instance per object, whose poses change without rebuilding the objects' trees. `render`
// may be called from several threads only on different scanners.
class Scanner {
 public:
  explicit Scanner(std::vector<ObjectPtr> objects, const ScannerOptions& options = {});
  ~Scanner();
  Scanner(Scanner&&) noexcept;
  Scanner& operator=(Scanner&&) noexcept;

  // Moves the objects; as many poses as objects. Throws std::invalid_argument otherwise.
  void set_poses(const std::vector<Pose>& T_world_object);

  // Hides (false) or shows (true) object i.
  void set_visible(int object, bool visible);

  // Throws std::invalid_argument unless the camera has a positive size and focal length. From inside an object one sees
  // its far side, from below the table its lower side; viewpoint_problem (synthetic_view.h) says so beforehand.
  Scan render(const Camera& camera, const Pose& T_world_camera) const;
  // The same into images that are there already, whose memory is used again if their size fits: for many scans.
  void render(const Camera& camera, const Pose& T_world_camera, Scan& scan) const;

  // Depth and labels inside the pixel rectangle [u0, u1) x [v0, v1) alone, at every `stride`-th pixel, for render
  // and compare; the images have ceil(size / stride) pixels.
  Scan render_window(const Camera& camera, const Pose& T_world_camera, int u0, int v0, int u1, int v1,
                     int stride = 1) const;

  struct Hit {
    double distance = 0.0;                             // along the unit direction, metres
    int object = -1;                                   // -1 the table
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // world frame, unit, outward
  };
  std::optional<Hit> cast_ray(const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world) const;

  struct Segment {
    Eigen::Vector3f from, to;  // world, metres
  };
  // For each segment 1 if something lies on it, else 0. Neighbours in the list should lie close to one another.
  std::vector<std::uint8_t> occluded(const std::vector<Segment>& segments) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dofusion
