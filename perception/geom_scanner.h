// Renders scans of MuJoCo's geoms by ray casting (Embree): any model's, with any number of geoms.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "perception/camera.h"
#include "perception/image.h"
#include "perception/scanner.h"
#include "stability/geom.h"

namespace dofusion {

struct GeomScan {
  DepthImage depth;     // z-depth, metres, exact; 0 where nothing is hit
  IdImage geoms;        // index of the geom that is seen; -1 nothing
  IdImage bodies;       // index of its body; -1 nothing
  NormalImage normals;  // outward unit normals in the camera's frame; zero where nothing is hit
};

struct GeomScannerOptions {
  std::array<bool, 6> groups{true, true, true, false, false, false};  // shown; MuJoCo's viewers begin with the same
};

// One Embree scene with a geometry per geom, whose poses change without rebuilding the meshes' trees. `render` and the
// like may be called from several threads only on different scanners.
//   Primitives are intersected by formula in double precision. Meshes and height fields (their closed surfaces) are
// found by Embree in float, the depth on the triangle that was found is worked out in double. All agrees with MuJoCo's
// mj_ray to 1e-5 m but for rays that pass within about 1e-6 m (times the distance in metres) of a silhouette or an
// edge, which may hit or miss, and except:
//   - mj_ray (2.2.2) puts wrong upper edges on the two walls of a height field at x = +-half;
//   - from inside a height field mj_ray also sees the top of its base box, here only its outer surface is there;
//   - mj_ray shows planes and height fields whatever their group, here groups count for them as for others;
//   - what has alpha 0 is hidden, by the colour that a geom is drawn with; mj_ray takes its material's, if it has one.
// A plane is seen from its front alone; from inside any other geom one sees its far side, as with mj_ray. Other alphas
// are opaque.
class GeomScanner {
 public:
  // Poses of bodies are the identity until set. Throws std::invalid_argument as check_geom.
  explicit GeomScanner(std::vector<Geom> geoms, const GeomScannerOptions& options = {});
  ~GeomScanner();
  GeomScanner(GeomScanner&&) noexcept;
  GeomScanner& operator=(GeomScanner&&) noexcept;

  const std::vector<Geom>& geoms() const;

  // Moves the bodies. Throws std::invalid_argument if a geom's body has none, or for a pose that is not finite.
  void set_poses(const std::vector<Pose>& T_world_body);

  void set_group_visible(int group, bool visible);  // 0 to 5; throws std::invalid_argument
  void set_visible(int geom, bool visible);         // hides a geom whatever its group, or lets the group decide

  // The same image for any number of threads. Throws std::invalid_argument unless the camera has a positive size and
  // focal lengths. From below a plane, or inside a geom, it shows what is seen from there.
  GeomScan render(const Camera& camera, const Pose& T_world_camera, int threads = 1) const;

  struct Hit {
    double distance = 0.0;  // along the unit direction, metres
    int geom = -1, body = -1;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // world frame, unit, outward
  };
  std::optional<Hit> cast_ray(const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world) const;

  // For each segment 1 if something lies on it, else 0.
  std::vector<std::uint8_t> occluded(const std::vector<Scanner::Segment>& segments) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The scan with 8-bit labels: of body i label_of_body[i], kLabelNothing where nothing is seen. Throws
// std::invalid_argument if a body that is seen has none.
Scan labelled(const GeomScan& scan, const std::vector<std::uint8_t>& label_of_body);

// The angle between the surface's normal and the direction to the camera at every pixel, in [0, pi]; above pi / 2 a
// surface is seen from behind. 0 where the normal is zero: nothing is seen.
AngleImage incidence_angles(const NormalImage& normals, const Camera& camera);

}  // namespace dofusion
