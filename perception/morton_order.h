// Points along a curve that keeps neighbours together.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace dofusion {

// The order of points along Morton's curve (Z order), 1024 cells along each side of their bounding box. O(n). Points
// that are not finite are somewhere among the others.
std::vector<std::uint32_t> morton_order(const std::vector<Eigen::Vector3d>& points);

}  // namespace dofusion
