// The seven blocks of the paper (after Janner et al. 2019), as base shapes that scenes scale.
#pragma once

#include <string>
#include <vector>

#include "stability/mesh.h"

namespace dofusion {

inline constexpr double kBlockUnit = 0.025;  // metres in one unit: half a cube edge

// "cube", "rectangle", "half_rectangle", "tall_triangle", "middle_triangle", "tetrahedron", "hat", in this order.
const std::vector<std::string>& block_names();

// The block's mesh in metres, origin at the centre of mass. Throws std::invalid_argument on an unknown name.
TriangleMesh block_mesh(const std::string& name);

// A box with the given edge lengths in metres, centred at the origin: 8 vertices, 12 triangles.
TriangleMesh box_mesh(const Eigen::Vector3d& edges);

// A prism over a convex polygon (counter-clockwise in x-y), from z = z_min to z_max.
TriangleMesh prism_mesh(const std::vector<Eigen::Vector2d>& polygon, double z_min, double z_max);

// Tessellations whose corners lie on the round surface, centred at the origin; the bounding box is the solid's own.
// The surface lies at most 0.0012 (cylinder) or 0.005 (sphere) radii inside the round one.
TriangleMesh cylinder_mesh(double radius, double height);  // about z, 64 sides
TriangleMesh sphere_mesh(double radius);                   // 32 rings of 64

}  // namespace dofusion
