// All rotations that leave a solid as it is: finitely many, those about an axis, or all there are.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "stability/mesh.h"
#include "stability/scene.h"

namespace dofusion {

// A ball keeps every rotation about its centre. With an axis, every rotation about it is a symmetry, and so is what it
// makes with `rotations`, which then hold nothing but the half turn that swaps the ends, if there is one. Otherwise
// `rotations` are all of them but the identity. Reflections are none.
struct ShapeSymmetry {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // metres; the rotations are about it
  bool ball = false;
  std::optional<Eigen::Vector3d> axis;     // unit; a solid of revolution's, through the centre
  std::vector<Eigen::Matrix3d> rotations;  // without the identity
};

// A rotation is a symmetry if it moves no point of the surface farther from the surface than `tolerance` times the
// mesh's diameter. At 0.01 a flat regular prism of 16 sides is round (it deviates by 0.0096) and so is a bowl of 16,
// while one of 15 is not; a tall one needs fewer sides, for its diameter is its height (8 from a height of 3.7 widths).
//   Complete for solids of revolution, balls, and meshes of at most 400 corners (points where the surface bends in more
// than one direction). Of meshes of more corners those about the principal axes are found: turns by 1/2 ... 1/12 about
// the one whose moment differs from two equal ones, half turns about all three.
//   The mesh may be in any frame, open or closed, however it was cut into triangles; `centre` is the centre of the
// surface's area, which every symmetry keeps. Throws std::invalid_argument if it has no area.
ShapeSymmetry symmetry_of(const TriangleMesh& mesh, double tolerance = 0.01);

// The same of an object, about its origin, which is its centre of mass. Of cylinders and spheres it is exact.
ShapeSymmetry symmetry_of(const Object& object, double tolerance = 0.01);

}  // namespace dofusion
