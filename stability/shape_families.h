// Families of shapes drawn from a seed, with exact geometry: what a placement model should have seen.
#pragma once

#include <string>
#include <vector>

#include "stability/random.h"
#include "stability/scene.h"
#include "stability/shapes.h"

namespace dofusion {

// Proportions are drawn within the ranges given; `scaled` (stability/scene.h) varies them and the size further.
enum class ShapeFamilyKind {
  kBox,         // edges from 1:1:1 to 1:8, log-uniform
  kPrism,       // 3 … 8 sides, half of them regular; height 0.25 … 3 times the section's width
  kCylinder,    // height 0.25 … 3 times the diameter
  kPolyhedron,  // the hull of 8 … 24 points over an ellipsoid whose axes differ up to 2 times, all of them corners
  kEll,         // two arms of their own thickness
  kTee,         // a bar on a stem that stands off its middle or under it
  kArch,        // a lintel on two legs; upside down it is a U
  kBowl,        // a conical wall of 16 sides on a flat foot
  kMug,         // an upright wall of 16 sides with a bottom and a handle
};

// "box", "prism", "cylinder", "polyhedron", "ell", "tee", "arch", "bowl", "mug", in the order above.
const std::vector<std::string>& shape_family_names();
const std::string& to_string(ShapeFamilyKind family);
ShapeFamilyKind shape_family_kind_from_string(const std::string& name);  // std::invalid_argument with the choices

// Every shape has the diameter of the cube block, in metres: slender and hollow ones hold less volume.
inline constexpr double kShapeDiameter = 3.4641016151377544 * kBlockUnit;  // 2 sqrt(3) units

// A shape of the family, named after it. Meshes are closed, without inner faces; mesh, volume and inertia agree exactly
// (a cylinder's are those of the round solid). Those of kEll and later have `parts`, convex solids that fill the mesh
// without overlap: 2 for an ell or a tee, 3 for an arch, 17 for a bowl, 23 for a mug.
ObjectPtr draw_shape(ShapeFamilyKind family, Rng& rng);

}  // namespace dofusion
