// Convex polygons in the plane.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace dofusion {

using Polygon = std::vector<Eigen::Vector2d>;  // convex, counter-clockwise

// normal · p <= offset; the normal has length 1.
struct HalfPlane {
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();
  double offset = 0.0;
};

// The convex hull's corners; fewer than three if the points lie on a line.
Polygon convex_hull_2d(std::vector<Eigen::Vector2d> points);

double area(const Polygon& polygon);

// Without the corners that lie nearer than `tolerance` to the line between their neighbours, the least important
// first, and further down to `max_corners`.
Polygon simplified(Polygon polygon, double tolerance, int max_corners);

// The part inside the half-plane; empty if there is none.
Polygon clipped(const Polygon& polygon, const HalfPlane& half_plane);

// One half-plane an edge.
std::vector<HalfPlane> half_planes(const Polygon& polygon);

bool contains(const Polygon& polygon, const Eigen::Vector2d& point);

// The rectangle with sides along (cos yaw, sin yaw) and across, between the given bounds in these directions.
Polygon rectangle(double yaw, const Eigen::Vector2d& low, const Eigen::Vector2d& high);

// Direction in [0, pi/2) of the sides of the rectangle of least area around the polygon.
double least_rectangle_yaw(const Polygon& polygon);

}  // namespace dofusion
