// Convex polyhedra: cutting, distances, overlap.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "perception/polygon.h"
#include "stability/mesh.h"

namespace dofusion {

// normal · p <= offset; the normal has length 1.
struct HalfSpace {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset = 0.0;
};

// The half-spaces of a convex mesh's faces, each plane once.
std::vector<HalfSpace> half_spaces(const TriangleMesh& convex);

// The convex hull of the points without throwing: nullopt if they (nearly) span no volume.
std::optional<TriangleMesh> solid_hull(const std::vector<Eigen::Vector3d>& points);

// The part of a convex mesh inside the half-space; nullopt if there is none with a volume.
std::optional<TriangleMesh> cut(const TriangleMesh& convex, const HalfSpace& half_space);

// A prism over `profile`, given in the coordinates (x, y) of the frame, from low to high along the frame's z. The
// columns of R are the frame's axes. nullopt if it has no volume.
std::optional<TriangleMesh> prism(const Eigen::Matrix3d& R, const Polygon& profile, double low, double high);

// Largest signed distance to the faces' planes: exact inside (negative) and before a face, a lower bound elsewhere.
double plane_distance(const std::vector<HalfSpace>& body, const Eigen::Vector3d& point);

// Where a ray enters the body, in multiples of `direction`; nullopt if it misses or starts inside.
std::optional<double> enter(const std::vector<HalfSpace>& body, const Eigen::Vector3d& origin,
                            const Eigen::Vector3d& direction);

// The least translation that parts two convex meshes (separating axes: face normals and products of edges):
// `depth` > 0 is how deep they overlap, <= 0 that they do not, and `axis` points from a to b.
struct Overlap {
  double depth = 0.0;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
};
Overlap find_overlap(const TriangleMesh& a, const TriangleMesh& b);

}  // namespace dofusion
