// Objects and scenes: the vocabulary that all modules share.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stability/mesh.h"
#include "stability/pose.h"

namespace dofusion {

struct SdfGrid;  // stability/sdf.h

// A rigid, uniform solid. Its frame has the origin at the centre of mass.
struct Object {
  std::string name;
  TriangleMesh mesh;                           // closed, own frame, metres
  std::optional<Eigen::Vector3d> box_edges;    // set if the mesh is exactly this box, centred and aligned
  double volume = 0.0;                         // cubic metres
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
// boxes. Throws std::invalid_argument if the mesh is not closed or has no volume.
ObjectAndOffset make_object(const std::string& name, const TriangleMesh& mesh);
ObjectPtr make_box(const std::string& name, const Eigen::Vector3d& edges);
ObjectPtr make_block(const std::string& name, double scale = 1.0);  // one of block_names()
std::vector<ObjectPtr> all_blocks();

// Objects at their poses; the table is the plane z = 0, z up.
struct Scene {
  std::vector<ObjectPtr> objects;
  std::vector<Pose> T_world_object;  // as many as objects
};

}  // namespace dofusion
