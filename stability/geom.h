// The shapes that MuJoCo's scenes are made of, and their cameras, as plain data: what a scanner or a picture needs.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "stability/mesh.h"
#include "stability/pose.h"

namespace dofusion {

// What `size` says, in metres, in the geom's frame:
//   kPlane        half x, half y, unused: a rectangle at z = 0, seen from z > 0 alone; 0 or less: no end that way
//   kHeightField  unused
//   kSphere       radius
//   kCapsule      radius, half the length of its straight part, along z
//   kEllipsoid    semi-axes
//   kCylinder     radius, half length, along z
//   kBox          half edges
//   kMesh         unused
enum class GeomType : std::uint8_t { kPlane, kHeightField, kSphere, kCapsule, kEllipsoid, kCylinder, kBox, kMesh };

// A landscape on a base: heights over a grid of points that spans [-half x, half x] x [-half y, half y].
struct HeightField {
  int rows = 0, columns = 0;                            // points along y and along x, two at least
  Eigen::Vector2d half_size = Eigen::Vector2d::Zero();  // metres
  double base = 0.0;                                    // metres from z = 0 down to its bottom
  std::vector<float> heights;                           // (rows * columns) metres above z = 0, row by row
};

struct Geom {
  std::string name;  // as in the file; may be empty
  GeomType type = GeomType::kSphere;
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  std::shared_ptr<const TriangleMesh> mesh;         // kMesh: as it is drawn, in the geom's frame; equal ones share it
  std::shared_ptr<const HeightField> height_field;  // kHeightField
  int body = 0;                                     // index of the scene's body that it is fixed to
  Pose T_body_geom = Pose::Identity();
  int group = 0;                                      // 0 to 5; viewers show or hide groups
  std::array<float, 4> rgba{0.5f, 0.5f, 0.5f, 1.0f};  // 0 to 1; alpha 0: it is not to be seen
  bool touchable = true;                              // or only to be seen
};

// A camera of a file. Its frame is OpenCV's, as of all cameras here: x right, y down, z forward.
struct SceneCamera {
  std::string name;                       // may be empty
  int body = -1;                          // index of the moving body that it is fixed to; -1: it stands in the world
  Pose T_body_camera = Pose::Identity();  // T_world_camera if it stands in the world
  double fovy = 0.0;                      // radians, the image's height; camera_of_fovy makes a Camera of it
};

// T_world_camera with the bodies at these poses, one for each of the scene's bodies.
Pose camera_pose(const SceneCamera& camera, const std::vector<Pose>& T_world_body);

// Throws std::invalid_argument saying what is wrong: a pose or size that is not finite or not positive where it must
// be; a mesh or height field that is missing or has nothing in it, or whose indices or coordinates make no sense.
void check_geom(const Geom& geom);

// The landscape's surface, walls and bottom, closed. A cell between four points is two triangles that meet along the
// diagonal from its (row, column) to its (row + 1, column + 1), as for MuJoCo.
TriangleMesh height_field_mesh(const HeightField& field);

}  // namespace dofusion
