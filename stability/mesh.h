// Triangle meshes and what follows exactly from them.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "stability/random.h"

namespace dofusion {

// Triangles wind counter-clockwise seen from outside.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;   // (V) metres
  std::vector<Eigen::Vector3i> triangles;  // (T) indices into vertices
};

struct BoundingBox {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
};

double volume(const TriangleMesh& mesh);              // signed: negative if the mesh is inside out
Eigen::Vector3d centre_of_mass(const TriangleMesh&);  // of the uniform solid; the mesh must have a volume
Eigen::Matrix3d inertia(const TriangleMesh& mesh);    // about the origin, of the uniform solid at 1 kg/m3: kg m2
double diameter(const TriangleMesh& mesh);            // largest distance between two vertices
BoundingBox bounding_box(const TriangleMesh& mesh);   // throws std::invalid_argument without vertices
double surface_area(const TriangleMesh& mesh);

// Every edge is shared by two triangles that run through it in opposite directions, or by four, six, … of them, as
// many one way as the other (two boxes that touch along an edge). Vertices are compared by position, so that a mesh
// with one vertex per corner and face, as STL has, counts as closed. stability/mesh_topology.h says what is wrong
// otherwise.
bool is_closed(const TriangleMesh& mesh);

// No vertex lies more than `tolerance` times the bounding box's diagonal before the plane of any face.
bool is_convex(const TriangleMesh& mesh, double tolerance = 1e-4);

// Merges vertices at the same position and drops triangles without area.
TriangleMesh weld(const TriangleMesh& mesh);

TriangleMesh translated(TriangleMesh mesh, const Eigen::Vector3d& t);
TriangleMesh scaled(TriangleMesh mesh, const Eigen::Vector3d& factors);  // factors > 0, per axis

struct SurfaceSample {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;  // outward, of the triangle
};

// `count` points drawn uniformly over the surface.
std::vector<SurfaceSample> sample_surface(const TriangleMesh& mesh, int count, Rng& rng);

}  // namespace dofusion
