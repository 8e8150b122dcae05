// Points spread evenly over a surface.
#pragma once

#include <vector>

#include "stability/mesh.h"
#include "stability/random.h"

namespace dofusion {

// Exactly `count` points, spread as a Poisson disc over the surface: of four times as many uniform ones those that have
// most others around them are eliminated, one after another (Yuksel, "Sample Elimination for Generating Poisson Disk
// Sample Sets", 2015). Distances are straight ones, so that the two sides of a thin plate keep apart as well. As
// uniform in area as sample_surface and much evener: no two points come nearer than about 0.65 of the distance in the
// densest packing. Same seed, same points, in random order. O(count log count). Throws std::invalid_argument if the
// mesh has no surface.
std::vector<SurfaceSample> sample_surface_evenly(const TriangleMesh& mesh, int count, Rng& rng);

// The distance between neighbours if `count` points were packed as densely as they can be on a plane of this area,
// which no set on the plane exceeds: sqrt(2 area / (sqrt(3) count)).
double densest_spacing(double area, int count);

}  // namespace dofusion
