#include "stability/shape_symmetry.h"

#include <cmath>
#include <map>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "stability/shape_families.h"
#include "stability/shapes.h"
#include "stability/triangle_tree.h"

namespace dofusion {
namespace {

TriangleMesh regular_prism(int sides, double radius, double height) {
  std::vector<Eigen::Vector2d> polygon;
  for (int k = 0; k < sides; ++k) {
    const double angle = 2.0 * M_PI * k / sides;
    polygon.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return prism_mesh(polygon, -0.5 * height, 0.5 * height);
}

// A body of revolution about z of a profile (radius, z) from the axis to the axis, upwards.
TriangleMesh revolved(const std::vector<Eigen::Vector2d>& profile, int sides) {
  TriangleMesh mesh;
  for (const Eigen::Vector2d& p : profile) {
    for (int k = 0; k < sides; ++k) {
      const double angle = 2.0 * M_PI * k / sides;
      mesh.vertices.emplace_back(p.x() * std::cos(angle), p.x() * std::sin(angle), p.y());
    }
  }
  for (int ring = 0; ring + 1 < static_cast<int>(profile.size()); ++ring) {
    for (int k = 0; k < sides; ++k) {
      const int a = ring * sides + k, b = ring * sides + (k + 1) % sides;
      mesh.triangles.emplace_back(a, b, b + sides);
      mesh.triangles.emplace_back(a, b + sides, a + sides);
    }
  }
  return weld(mesh);
}

TriangleMesh moved(TriangleMesh mesh, const Pose& pose) {
  for (Eigen::Vector3d& v : mesh.vertices) v = pose * v;
  return mesh;
}

Eigen::Matrix3d some_rotation() {
  return Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -3).normalized()).toRotationMatrix();
}

// The orders of the groups as in mesh_symmetry_test.cpp, less the identity.
TEST(ShapeSymmetry, OfTheBlocks) {
  const std::map<std::string, std::size_t> rotations = {
      {"cube", 23},       {"rectangle", 7}, {"half_rectangle", 3}, {"tall_triangle", 0}, {"middle_triangle", 1},
      {"tetrahedron", 3}, {"hat", 1}};
  for (const auto& [name, count] : rotations) {
    const ShapeSymmetry symmetry = symmetry_of(*make_block(name));
    EXPECT_FALSE(symmetry.ball) << name;
    EXPECT_FALSE(symmetry.axis) << name;
    EXPECT_EQ(symmetry.rotations.size(), count) << name;
    for (const Eigen::Matrix3d& R : symmetry.rotations) {
      EXPECT_NEAR(R.determinant(), 1.0, 1e-9) << name;
      EXPECT_FALSE(R.isIdentity(1e-3)) << name;
    }
  }
}

TEST(ShapeSymmetry, OfRoundSolids) {
  const ShapeSymmetry cylinder = symmetry_of(*make_cylinder("can", 0.03, 0.1));
  ASSERT_TRUE(cylinder.axis);
  EXPECT_EQ(*cylinder.axis, Eigen::Vector3d::UnitZ());
  EXPECT_EQ(cylinder.rotations.size(), 1u);
  EXPECT_TRUE(symmetry_of(*make_sphere("ball", 0.03)).ball);
  EXPECT_TRUE(symmetry_of(sphere_mesh(0.03)).ball);

  // The same from the mesh alone, in a frame of its own.
  const Pose pose = make_pose(some_rotation(), {0.3, -0.2, 0.1});
  const ShapeSymmetry found = symmetry_of(moved(cylinder_mesh(0.03, 0.1), pose));
  ASSERT_TRUE(found.axis);
  EXPECT_NEAR(std::abs(found.axis->dot(pose.linear().col(2))), 1.0, 1e-9);
  EXPECT_LT((found.centre - pose.translation()).norm(), 1e-9);
  EXPECT_EQ(found.rotations.size(), 1u);
}

TEST(ShapeSymmetry, AConeHasNoHalfTurnAndADoubleConeHas) {
  const ShapeSymmetry cone = symmetry_of(revolved({{0, 0}, {0.05, 0}, {0, 0.1}}, 48));
  ASSERT_TRUE(cone.axis);
  EXPECT_NEAR(std::abs(cone.axis->z()), 1.0, 1e-9);
  EXPECT_TRUE(cone.rotations.empty());
  const ShapeSymmetry spindle = symmetry_of(revolved({{0, -0.1}, {0.05, 0}, {0, 0.1}}, 48));
  ASSERT_TRUE(spindle.axis);
  EXPECT_EQ(spindle.rotations.size(), 1u);
}

// As wide as high: its three moments nearly agree, and the axis follows from its flat faces.
TEST(ShapeSymmetry, AxisWhereMomentsAreEqual) {
  const double radius = 0.05;
  for (const double ratio : {1.5, 1.6, 1.7, 1.73, 1.8, 1.9, 2.0}) {
    const ShapeSymmetry symmetry =
        symmetry_of(moved(cylinder_mesh(radius, ratio * radius), make_pose(some_rotation(), {0, 0, 0})));
    ASSERT_TRUE(symmetry.axis) << ratio;
    EXPECT_NEAR(std::abs(symmetry.axis->dot(some_rotation().col(2))), 1.0, 1e-6) << ratio;
  }
}

// A corner of a regular polygon of n sides, turned by half a side, lies R (1 - cos(pi/n)) outside it: of the diameter
// 2 R of a flat prism that is 0.0096 with 16 sides, 0.0109 with 15. A prism has n turns and n half turns.
TEST(ShapeSymmetry, PrismsOfManySidesAreRound) {
  for (const int sides : {16, 20, 64}) EXPECT_TRUE(symmetry_of(regular_prism(sides, 0.05, 0.001)).axis) << sides;
  for (const int sides : {3, 4, 5, 6, 8, 12}) {
    const ShapeSymmetry symmetry = symmetry_of(regular_prism(sides, 0.05, 0.02));
    EXPECT_FALSE(symmetry.axis) << sides;
    EXPECT_EQ(symmetry.rotations.size(), static_cast<std::size_t>(2 * sides - 1)) << sides;
  }
  EXPECT_FALSE(symmetry_of(regular_prism(15, 0.05, 0.001)).axis);
}

TEST(ShapeSymmetry, OfTheShapeFamilies) {
  for (int k = 0; k < 6; ++k) {
    Rng rng = make_rng(11, static_cast<std::uint64_t>(k));
    // Three different edges; two may be alike to 1 % in other draws.
    const ShapeSymmetry box = symmetry_of(*draw_shape(ShapeFamilyKind::kBox, rng));
    EXPECT_TRUE(box.rotations.size() == 3u || box.rotations.size() == 7u) << k;
    EXPECT_TRUE(symmetry_of(*draw_shape(ShapeFamilyKind::kCylinder, rng)).axis);
    EXPECT_TRUE(symmetry_of(*draw_shape(ShapeFamilyKind::kPolyhedron, rng)).rotations.empty());
    const ShapeSymmetry bowl = symmetry_of(*draw_shape(ShapeFamilyKind::kBowl, rng));
    ASSERT_TRUE(bowl.axis);
    EXPECT_NEAR(std::abs(bowl.axis->z()), 1.0, 1e-6);
    EXPECT_TRUE(bowl.rotations.empty());
    // The handle leaves nothing but a reflection.
    const ShapeSymmetry mug = symmetry_of(*draw_shape(ShapeFamilyKind::kMug, rng));
    EXPECT_FALSE(mug.axis);
    EXPECT_TRUE(mug.rotations.empty());
    // One half turn, about the vertical, if its legs are equal.
    const ShapeSymmetry arch = symmetry_of(*draw_shape(ShapeFamilyKind::kArch, rng));
    EXPECT_FALSE(arch.axis);
    EXPECT_LE(arch.rotations.size(), 1u);
  }
}

// What is found maps the surface onto itself: by another way, through distances of all points to the nearest triangle.
TEST(ShapeSymmetry, EveryRotationKeepsTheSurface) {
  const Pose pose = make_pose(some_rotation(), {0.1, 0.2, 0.3});
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = moved(block_mesh(name), pose);
    const ShapeSymmetry symmetry = symmetry_of(mesh);
    EXPECT_EQ(symmetry.rotations.size(), symmetry_of(*make_block(name)).rotations.size()) << name;
    const std::vector<SignedTriangle> triangles = signed_triangles(mesh);
    for (const Eigen::Matrix3d& R : symmetry.rotations) {
      for (const Eigen::Vector3d& v : mesh.vertices) {
        double nearest = 1.0;
        for (const SignedTriangle& t : triangles) {
          nearest = std::min(nearest, distance_to_triangle(t, symmetry.centre + R * (v - symmetry.centre)).squared);
        }
        EXPECT_LT(std::sqrt(nearest), 1e-9) << name;
      }
    }
  }
}

TEST(ShapeSymmetry, NoSurfaceIsRefused) {
  EXPECT_THROW(symmetry_of(TriangleMesh{}), std::invalid_argument);
  EXPECT_THROW(symmetry_of(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}}), std::invalid_argument);
}

TEST(TriangleTree, AgreesWithEveryTriangle) {
  const TriangleMesh mesh = sphere_mesh(0.05);
  const TriangleTree tree(mesh);
  const std::vector<SignedTriangle> triangles = signed_triangles(mesh);
  Rng rng = make_rng(3, 0);
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector3d point(uniform(rng, -0.1, 0.1), uniform(rng, -0.1, 0.1), uniform(rng, -0.1, 0.1));
    double squared = 1.0;
    for (const SignedTriangle& t : triangles) squared = std::min(squared, distance_to_triangle(t, point).squared);
    const double distance = std::sqrt(squared);
    EXPECT_TRUE(tree.any_within(point, distance * 1.0001));
    EXPECT_FALSE(tree.any_within(point, distance * 0.9999));
  }
}

}  // namespace
}  // namespace dofusion
