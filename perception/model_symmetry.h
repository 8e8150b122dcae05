// Rotations that leave a model as it is, as BOP's models_info.json lists them.
#pragma once

#include <vector>

#include "stability/mesh.h"
#include "stability/pose.h"

namespace dofusion {

// Rotations by any angle about a line.
struct ContinuousSymmetry {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();   // unit
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // a point of the line, metres
};

struct ModelSymmetries {
  std::vector<Pose> discrete;                  // without the identity
  std::vector<ContinuousSymmetry> continuous;  // three, at right angles, of a ball
};

struct ModelSymmetryOptions {
  // A rotation is a symmetry if it moves no point of the surface farther from the surface than this share of the
  // mesh's diameter. At 0.01 a regular prism of 16 sides or more is round (it deviates by at most 0.0096), and so is a
  // bowl of 16; one of 15 or fewer is not unless it is taller than it is wide.
  double tolerance = 0.01;
};

// The symmetries of a mesh in any frame, open or closed, however it was cut into triangles. They are about the
// surface's centre of area, which every symmetry keeps; a reflection is none. Of a solid of revolution, `discrete`
// holds nothing but the half turn that swaps its ends, if there is one: with `continuous` it makes all the others.
//   Complete for solids of revolution, balls, and meshes of at most 400 corners (points where the surface bends in more
// than one direction). Of meshes of more corners those about the principal axes are found: turns by 1/2 ... 1/12 about
// the distinct one, half turns about all three.
//   Throws std::invalid_argument if the mesh has no area. Meshes of a million triangles take a few seconds.
ModelSymmetries model_symmetries(const TriangleMesh& mesh, const ModelSymmetryOptions& options = {});

}  // namespace dofusion
