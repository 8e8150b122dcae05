#include "stability/scene.h"

#include <gtest/gtest.h>

#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

TEST(MakeBox, HasTheInertiaOfABox) {
  const ObjectPtr box = make_box("b", {1, 2, 3});
  EXPECT_EQ(box->kind, SolidKind::kBox);
  // volume / 12 (b^2 + c^2) about the axis of a
  const Vector3d expected = 6.0 / 12.0 * Vector3d(4 + 9, 1 + 9, 1 + 4);
  EXPECT_LT((box->inertia - Matrix3d(expected.asDiagonal())).norm(), 1e-12);
}

TEST(MakeCylinder, HasTheFiguresOfTheRoundOne) {
  const double r = 0.03, h = 0.1;
  const ObjectPtr cylinder = make_cylinder("c", r, h);
  EXPECT_EQ(cylinder->kind, SolidKind::kCylinder);
  EXPECT_TRUE(cylinder->convex);
  EXPECT_NEAR(cylinder->volume, M_PI * r * r * h, 1e-18);
  EXPECT_NEAR(cylinder->diameter, std::sqrt(4 * r * r + h * h), 1e-15);
  const double mass = cylinder->volume;  // at 1 kg/m3
  const Vector3d expected(mass * (3 * r * r + h * h) / 12, mass * (3 * r * r + h * h) / 12, mass * r * r / 2);
  EXPECT_LT((cylinder->inertia - Matrix3d(expected.asDiagonal())).norm(), 1e-12 * expected.norm());
  // The mesh of 64 sides holds sin(2 pi / 64) / (2 pi / 64) = 0.9984 of it.
  const double sides = 2.0 * M_PI / 64.0;
  EXPECT_NEAR(volume(cylinder->mesh) / cylinder->volume, std::sin(sides) / sides, 1e-12);
  EXPECT_LT((inertia(cylinder->mesh) - cylinder->inertia).norm(), 0.004 * cylinder->inertia.norm());
}

TEST(MakeSphere, HasTheFiguresOfTheRoundOne) {
  const double r = 0.04;
  const ObjectPtr sphere = make_sphere("s", r);
  EXPECT_EQ(sphere->kind, SolidKind::kSphere);
  EXPECT_NEAR(sphere->volume, 4.0 / 3.0 * M_PI * r * r * r, 1e-18);
  EXPECT_EQ(sphere->diameter, 2 * r);
  EXPECT_LT((sphere->inertia - Matrix3d::Identity() * (0.4 * sphere->volume * r * r)).norm(),
            1e-12 * sphere->inertia.norm());
  EXPECT_LT((inertia(sphere->mesh) - sphere->inertia).norm(), 0.02 * sphere->inertia.norm());
}

TEST(RoundMeshes, StayWithinTheirDistanceOfTheSurfaceAndFillItsBox) {
  const TriangleMesh cylinder = cylinder_mesh(2.0, 3.0), sphere = sphere_mesh(2.0);
  for (const TriangleMesh* mesh : {&cylinder, &sphere}) {
    EXPECT_TRUE(is_closed(*mesh));
    EXPECT_TRUE(is_convex(*mesh));
    EXPECT_LT((bounding_box(*mesh).max + bounding_box(*mesh).min).norm(), 1e-12);
    const Vector3d half = mesh == &sphere ? Vector3d(2, 2, 2) : Vector3d(2, 2, 1.5);
    EXPECT_LT((bounding_box(*mesh).max - half).norm(), 1e-12);
  }
  Rng rng = make_rng(1);
  for (const SurfaceSample& s : sample_surface(sphere, 20000, rng)) {
    EXPECT_LE(s.point.norm(), 2.0 + 1e-12);
    EXPECT_GE(s.point.norm(), 2.0 * (1.0 - 0.005));
  }
  for (const SurfaceSample& s : sample_surface(cylinder, 20000, rng)) {
    if (std::abs(s.normal.z()) > 0.5) continue;  // the flat ends
    EXPECT_LE(s.point.head<2>().norm(), 2.0 + 1e-12);
    EXPECT_GE(s.point.head<2>().norm(), 2.0 * (1.0 - 0.0013));  // cos(pi / 64) = 1 - 0.0012
  }
}

TEST(Scaled, KeepsTheKindWhereTheFactorsAllow) {
  const ObjectPtr box = scaled(*make_box("b", {1, 2, 3}), {2, 3, 0.5});
  ASSERT_EQ(box->kind, SolidKind::kBox);
  EXPECT_LT((*box->box_edges - Vector3d(2, 6, 1.5)).norm(), 1e-12);

  const ObjectPtr cylinder = scaled(*make_cylinder("c", 1, 2), {3, 3, 0.5});
  ASSERT_EQ(cylinder->kind, SolidKind::kCylinder);
  EXPECT_NEAR(cylinder->volume, M_PI * 9.0 * 1.0, 1e-12);
  EXPECT_EQ(cylinder->name, "c");

  const ObjectPtr sphere = scaled(*make_sphere("s", 1), Vector3d::Constant(0.5));
  ASSERT_EQ(sphere->kind, SolidKind::kSphere);
  EXPECT_NEAR(sphere->diameter, 1.0, 1e-12);

  EXPECT_EQ(scaled(*make_cylinder("c", 1, 2), {1, 2, 1})->kind, SolidKind::kMesh);
  EXPECT_EQ(scaled(*make_sphere("s", 1), {1, 1, 2})->kind, SolidKind::kMesh);
}

TEST(Scaled, StretchesFiguresAsTheMesh) {
  const ObjectPtr hat = make_block("hat");
  const ObjectPtr stretched = scaled(*hat, {1, 2, 3});
  EXPECT_NEAR(stretched->volume, 6.0 * hat->volume, 1e-15);
  EXPECT_LT((stretched->inertia - inertia(stretched->mesh)).norm(), 1e-15 * stretched->inertia.norm());
  EXPECT_EQ(stretched->diameter, diameter(stretched->mesh));
  EXPECT_LT(centre_of_mass(stretched->mesh).norm(), 1e-12);
  EXPECT_THROW(scaled(*hat, {1, 0, 1}), std::invalid_argument);
  EXPECT_THROW(scaled(*hat, {1, -1, 1}), std::invalid_argument);
}

TEST(MakeObject, MovesPartsWithTheMeshAndDropsThemFromConvexOnes) {
  const TriangleMesh low = box_mesh({4, 2, 1}), high = translated(box_mesh({1, 2, 2}), {-1.5, 0, 1.5});
  TriangleMesh ell = prism_mesh({{0, 0}, {1, 0}, {0, 1}}, 0, 1);
  const ObjectAndOffset convex = make_object("p", ell, {ell});
  EXPECT_TRUE(convex.object->parts.empty());
  TriangleMesh both = low;
  for (const Vector3d& v : high.vertices) both.vertices.push_back(v);
  for (const Eigen::Vector3i& t : high.triangles) both.triangles.push_back(t + Eigen::Vector3i::Constant(8));
  const ObjectAndOffset made = make_object("l", both, {low, high});
  ASSERT_EQ(made.object->parts.size(), 2u);
  // 8 m3 about the origin and 4 m3 about (-1.5, 0, 1.5)
  EXPECT_LT((made.origin - Vector3d(-0.5, 0, 0.5)).norm(), 1e-12);
  EXPECT_LT((centre_of_mass(made.object->parts[0]) - Vector3d(0.5, 0, -0.5)).norm(), 1e-12);
}

}  // namespace
}  // namespace dofusion
