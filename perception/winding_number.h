// How often a surface winds around a point: tells inside from outside where the surface has holes.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "perception/triangle_tree.h"

namespace dofusion {

// The triangles under one child of a node, as one from afar.
struct Dipole {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // weighted by area
  Eigen::Vector3d area = Eigen::Vector3d::Zero();    // the sum of their area vectors, outward
  double radius = 0.0;                               // all of them are this near to the centre
};
using NodeDipoles = std::array<Dipole, kTreeLanes>;
std::vector<NodeDipoles> make_dipoles(const TriangleTree& tree);  // per node of the tree

// The generalised winding number (Jacobson et al. 2013): the surface's solid angle over 4 pi. Of a closed surface 1
// inside and 0 outside; near a hole it passes smoothly from one to the other. By exact solid angles near by and dipoles
// from afar (Barill et al. 2018, first order): errs by less than 0.01.
double winding_number(const TriangleTree& tree, const std::vector<NodeDipoles>& dipoles, const Eigen::Vector3d& point);

}  // namespace dofusion
