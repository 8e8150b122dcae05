// Closed meshes swept from plane outlines that need not be convex: extruded polygons and solids of revolution.
#pragma once

#include <vector>

#include "stability/mesh.h"

namespace dofusion {

// The polygon's area, positive if its corners run counter-clockwise.
double signed_area(const std::vector<Eigen::Vector2d>& polygon);

// Triangles over the polygon's own corners, counter-clockwise as they are (ear clipping). The polygon is simple and
// counter-clockwise; corners on a straight side are allowed. Throws std::invalid_argument otherwise.
std::vector<Eigen::Vector3i> triangulated(const std::vector<Eigen::Vector2d>& polygon);

// The prism over a simple polygon, counter-clockwise in x-y, from z_min to z_max. Throws as `triangulated` does.
TriangleMesh extrusion_mesh(const std::vector<Eigen::Vector2d>& polygon, double z_min, double z_max);

// The profile (r, z) turned about the z axis in `sides` >= 3 flat sides. The profile is an open line from the axis out
// and up and back to the axis: r = 0 at both ends and nowhere else, the solid on its left. Corner i of every ring lies
// at the angle 2 pi (i - 1/2) / sides, so that side 0, between corners 0 and 1, faces +x. Throws std::invalid_argument
// on another profile.
TriangleMesh revolution_mesh(const std::vector<Eigen::Vector2d>& profile, int sides);

// The point of such a ring.
Eigen::Vector3d ring_corner(double radius, double z, int corner, int sides);

// The volume of the round solid of such a profile with circles for its rings is this times pi; with `sides` flat sides
// it is this times sides/2 sin(2 pi / sides): sum over the profile of dz (r0^2 + r0 r1 + r1^2) / 3.
double revolution_moment(const std::vector<Eigen::Vector2d>& profile);

}  // namespace dofusion
