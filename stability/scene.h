// Objects and scenes: the vocabulary that all modules share.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stability/mesh.h"
#include "stability/pose.h"

namespace dofusion {

struct SdfGrid;  // stability/sdf.h

// What physics takes a solid for. A primitive is centred, lies along the axes (a cylinder's axis is z), and fills the
// bounding box of its mesh; the mesh of a round one is a fine tessellation of it.
enum class SolidKind : std::uint8_t { kMesh = 0, kBox = 1, kCylinder = 2, kSphere = 3 };

// A rigid, uniform solid. Its frame has the origin at the centre of mass.
struct Object {
  std::string name;
  TriangleMesh mesh;                           // closed, own frame, metres
  SolidKind kind = SolidKind::kMesh;
  std::optional<Eigen::Vector3d> box_edges;    // set if `kind` is kBox
  std::vector<TriangleMesh> parts;             // convex solids that make up one that is not, own frame; else empty
  double volume = 0.0;                         // cubic metres
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the origin at a density of 1 kg/m3, in kg m2
  double diameter = 0.0;                       // metres; what displacements are divided by
  bool convex = true;
  std::shared_ptr<const SdfGrid> sdf;          // signed distances, own frame, where a grid was made; else null
};

using ObjectPtr = std::shared_ptr<const Object>;

struct ObjectAndOffset {
  ObjectPtr object;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // the object's origin in the frame the mesh was given in
};

// Makes an object of a closed mesh given in any frame, moving the origin to the centre of mass and recognising
// boxes. `parts`: convex solids in the same frame that make up one that is not convex; without them physics finds its
// own (stability/convex_parts.h). Throws std::invalid_argument if the mesh is not closed or has no volume.
ObjectAndOffset make_object(const std::string& name, const TriangleMesh& mesh,
                            const std::vector<TriangleMesh>& parts = {});
ObjectPtr make_box(const std::string& name, const Eigen::Vector3d& edges);
ObjectPtr make_cylinder(const std::string& name, double radius, double height);  // about z
ObjectPtr make_sphere(const std::string& name, double radius);
ObjectPtr make_block(const std::string& name, double scale = 1.0);  // one of block_names()
std::vector<ObjectPtr> all_blocks();

// The object stretched along its axes by `factors` > 0, which keep the origin at the centre of mass. Boxes stay boxes,
// cylinders and spheres stay what they are if the factors allow it; parts are stretched as well.
ObjectPtr scaled(const Object& object, const Eigen::Vector3d& factors);

// Objects at their poses; the table is the plane z = 0, z up.
struct Scene {
  std::vector<ObjectPtr> objects;
  std::vector<Pose> T_world_object;  // as many as objects
};

}  // namespace dofusion
