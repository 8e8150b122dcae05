#include "perception/model_symmetry.h"

#include <cmath>
#include <map>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "stability/shape_families.h"
#include "stability/swept_mesh.h"

namespace dofusion {
namespace {

TriangleMesh regular_prism(int sides, double height) {
  std::vector<Eigen::Vector2d> polygon;
  for (int k = 0; k < sides; ++k) {
    const double angle = 2.0 * M_PI * k / sides;
    polygon.emplace_back(std::cos(angle), std::sin(angle));
  }
  return prism_mesh(polygon, -height / 2.0, height / 2.0);
}

double distance_to_triangle_plain(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                  const Eigen::Vector3d& c) {
  const Eigen::Vector3d n = (b - a).cross(c - a);
  const Eigen::Vector3d foot = p - n * (n.dot(p - a) / n.squaredNorm());
  const auto side = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    return n.dot((to - from).cross(foot - from)) >= 0.0;
  };
  if (side(a, b) && side(b, c) && side(c, a)) return (p - foot).norm();
  double nearest = INFINITY;
  for (const auto& [from, to] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) {
    const Eigen::Vector3d edge = to - from;
    const double t = std::clamp(edge.dot(p - from) / edge.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (p - from - t * edge).norm());
  }
  return nearest;
}

// Largest distance of the mesh's vertices, moved, from the mesh.
double deviation(const TriangleMesh& mesh, const Pose& motion) {
  double largest = 0.0;
  for (const Eigen::Vector3d& v : mesh.vertices) {
    double nearest = INFINITY;
    for (const Eigen::Vector3i& t : mesh.triangles) {
      nearest = std::min(nearest, distance_to_triangle_plain(motion * v, mesh.vertices[t[0]], mesh.vertices[t[1]],
                                                             mesh.vertices[t[2]]));
    }
    largest = std::max(largest, nearest);
  }
  return largest;
}

void expect_maps_on_itself(const TriangleMesh& mesh, const ModelSymmetries& symmetries, const std::string& name) {
  for (const Pose& pose : symmetries.discrete) {
    EXPECT_NEAR(pose.linear().determinant(), 1.0, 1e-9) << name;
    EXPECT_FALSE(pose.isApprox(Pose::Identity(), 1e-3)) << name;
    EXPECT_LE(deviation(mesh, pose), 0.01 * diameter(mesh)) << name;
  }
  for (const ContinuousSymmetry& symmetry : symmetries.continuous) {
    for (const double angle : {0.1, 1.0, 2.5}) {
      Pose turn = Pose::Identity();
      turn.translate(symmetry.offset).rotate(Eigen::AngleAxisd(angle, symmetry.axis)).translate(-symmetry.offset);
      EXPECT_LE(deviation(mesh, turn), 0.01 * diameter(mesh)) << name;
    }
  }
}

struct Counts {
  std::size_t discrete, continuous;
};

void expect_counts(const TriangleMesh& mesh, const Counts& counts, const std::string& name) {
  const ModelSymmetries symmetries = model_symmetries(mesh);
  EXPECT_EQ(symmetries.discrete.size(), counts.discrete) << name;
  EXPECT_EQ(symmetries.continuous.size(), counts.continuous) << name;
  expect_maps_on_itself(mesh, symmetries, name);
}

// The rotation groups without the identity: the cube's 24; a square cuboid's 8; 4 x 2 x 1 has half turns about three
// axes; a scalene prism has none; an isosceles one the half turn that swaps its ends; a square pyramid quarter turns.
TEST(ModelSymmetry, OfTheBlocks) {
  const std::map<std::string, std::size_t> discrete = {
      {"cube", 23},       {"rectangle", 7}, {"half_rectangle", 3}, {"tall_triangle", 0}, {"middle_triangle", 1},
      {"tetrahedron", 3}, {"hat", 1}};
  for (const auto& [name, count] : discrete) expect_counts(block_mesh(name), {count, 0}, name);
}

TEST(ModelSymmetry, OfRoundSolids) {
  expect_counts(cylinder_mesh(0.03, 0.1), {1, 1}, "cylinder");
  expect_counts(sphere_mesh(0.03), {0, 3}, "sphere");
  expect_counts(scaled(sphere_mesh(0.03), {1, 1, 2}), {1, 1}, "spheroid");
  expect_counts(scaled(sphere_mesh(0.03), {1, 2, 3}), {3, 0}, "ellipsoid: half turns about its axes");
  expect_counts(revolution_mesh({{0, 0}, {1, 0}, {0, 2}}, 64), {0, 1}, "cone");
  EXPECT_EQ(model_symmetries(cylinder_mesh(0.03, 0.1)).continuous[0].axis.cwiseAbs(), Eigen::Vector3d::UnitZ());
}

// Whatever the proportions: in some the moments of all axes are equal, and say nothing.
TEST(ModelSymmetry, OfCylindersOfAnyHeight) {
  for (double height = 0.2; height < 5.0; height += 0.1) {
    const ModelSymmetries symmetries = model_symmetries(cylinder_mesh(1.0, height));
    ASSERT_EQ(symmetries.continuous.size(), 1u) << height;
    EXPECT_NEAR(std::abs(symmetries.continuous[0].axis.z()), 1.0, 1e-6) << height;
    EXPECT_EQ(symmetries.discrete.size(), 1u) << height;
  }
}

// A regular prism of n sides and height h deviates from round by (1 - cos(pi / n)) / sqrt(4 + h^2) of its diameter.
TEST(ModelSymmetry, PrismsOfManySidesAreRound) {
  for (const int sides : {3, 5, 6, 8, 10, 12, 14}) {
    expect_counts(regular_prism(sides, 0.5), {2u * static_cast<unsigned>(sides) - 1u, 0}, std::to_string(sides));
  }
  for (const int sides : {16, 24, 64}) expect_counts(regular_prism(sides, 0.5), {1, 1}, std::to_string(sides));
  ModelSymmetryOptions strict;
  strict.tolerance = 0.001;
  EXPECT_EQ(model_symmetries(regular_prism(16, 0.5), strict).discrete.size(), 31u);
}

// Sections in x-y, extruded: a section's mirror line is the axis of a half turn.
TEST(ModelSymmetry, OfExtrusions) {
  const auto solid = [](const std::vector<Eigen::Vector2d>& section) { return extrusion_mesh(section, -0.3, 0.3); };
  expect_counts(solid({{0, 0}, {1, 0}, {1, 0.3}, {0.3, 0.3}, {0.3, 1}, {0, 1}}), {1, 0}, "ell of equal arms");
  expect_counts(solid({{0, 0}, {0.7, 0}, {0.7, 0.3}, {0.3, 0.3}, {0.3, 1}, {0, 1}}), {0, 0}, "ell");
  expect_counts(solid({{0.4, 0}, {0.6, 0}, {0.6, 0.7}, {1, 0.7}, {1, 1}, {0, 1}, {0, 0.7}, {0.4, 0.7}}), {1, 0}, "tee");
  expect_counts(solid({{0.3, 0}, {0.5, 0}, {0.5, 0.7}, {1, 0.7}, {1, 1}, {0, 1}, {0, 0.7}, {0.3, 0.7}}), {0, 0},
                "tee whose stem is not in the middle");
  expect_counts(solid({{0, 0}, {0.2, 0}, {0.2, 0.6}, {0.8, 0.6}, {0.8, 0}, {1, 0}, {1, 1}, {0, 1}}), {1, 0}, "arch");
}

TEST(ModelSymmetry, OfTheFamilies) {
  // A box is square in no direction, an ell has unequal arms, and so on, but for draws of measure zero; a mug is its
  // own mirror image, which is no rotation.
  const std::map<ShapeFamilyKind, Counts> counts = {
      {ShapeFamilyKind::kBox, {3, 0}},        {ShapeFamilyKind::kCylinder, {1, 1}},
      {ShapeFamilyKind::kPolyhedron, {0, 0}}, {ShapeFamilyKind::kEll, {0, 0}},
      {ShapeFamilyKind::kBowl, {0, 1}},       {ShapeFamilyKind::kMug, {0, 0}}};
  for (const auto& [family, expected] : counts) {
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      Rng rng = make_rng(seed, 11);
      expect_counts(draw_shape(family, rng)->mesh, expected, to_string(family) + " " + std::to_string(seed));
    }
  }
  for (const ShapeFamilyKind family : {ShapeFamilyKind::kPrism, ShapeFamilyKind::kTee, ShapeFamilyKind::kArch}) {
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      Rng rng = make_rng(seed, 12);
      const ObjectPtr object = draw_shape(family, rng);
      expect_maps_on_itself(object->mesh, model_symmetries(object->mesh), to_string(family));
    }
  }
}

// The frame may be anywhere: a symmetry is about the solid's own centre.
TEST(ModelSymmetry, InAnyFrame) {
  const Eigen::Vector3d at(0.3, -0.2, 0.5);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  TriangleMesh cube = block_mesh("cube"), cylinder = cylinder_mesh(0.03, 0.1);
  for (TriangleMesh* mesh : {&cube, &cylinder}) {
    for (Eigen::Vector3d& v : mesh->vertices) v = R * v + at;
  }
  expect_counts(cube, {23, 0}, "cube");
  for (const Pose& pose : model_symmetries(cube).discrete) EXPECT_LT((pose * at - at).norm(), 1e-9);
  const ModelSymmetries round = model_symmetries(cylinder);
  ASSERT_EQ(round.continuous.size(), 1u);
  EXPECT_LT(round.continuous[0].axis.cross(R.col(2)).norm(), 1e-6);
  EXPECT_LT((round.continuous[0].offset - at).norm(), 1e-9);
}

TEST(ModelSymmetry, AMeshWithoutAreaThrows) {
  EXPECT_THROW(model_symmetries(TriangleMesh{}), std::invalid_argument);
  EXPECT_THROW(model_symmetries(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}}), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
