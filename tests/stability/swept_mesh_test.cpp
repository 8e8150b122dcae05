#include "stability/swept_mesh.h"

#include <gtest/gtest.h>

#include "stability/random.h"

namespace dofusion {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

double covered(const Polygon& polygon, const std::vector<Eigen::Vector3i>& triangles) {
  double area = 0.0;
  for (const Eigen::Vector3i& t : triangles) {
    const double part = signed_area({polygon[t[0]], polygon[t[1]], polygon[t[2]]});
    EXPECT_GT(part, 0.0);
    area += part;
  }
  return area;
}

TEST(Triangulated, CoversTheStarShapedPolygonOnce) {
  Rng rng = make_rng(1);
  for (int trial = 0; trial < 50; ++trial) {
    const int n = uniform_int(rng, 3, 40);
    Polygon polygon;
    for (int i = 0; i < n; ++i) {
      const double angle = 2.0 * M_PI * i / n, radius = uniform(rng, 0.2, 1.0);
      polygon.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
    const auto triangles = triangulated(polygon);
    EXPECT_EQ(triangles.size(), polygon.size() - 2);
    EXPECT_NEAR(covered(polygon, triangles), signed_area(polygon), 1e-12);
  }
}

TEST(Triangulated, CopesWithCornersOnAStraightSide) {
  const Polygon polygon = {{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 1}, {3, 2}, {1.5, 2}, {0, 2}, {0, 1}};
  const auto triangles = triangulated(polygon);
  EXPECT_EQ(triangles.size(), polygon.size() - 2);
  EXPECT_NEAR(covered(polygon, triangles), 6.0, 1e-12);
}

TEST(Triangulated, RefusesClockwiseAndCrossingOutlines) {
  EXPECT_THROW(triangulated({{0, 0}, {0, 1}, {1, 0}}), std::invalid_argument);
  EXPECT_THROW(triangulated({{0, 0}, {1, 0}}), std::invalid_argument);
  EXPECT_THROW(triangulated({{0, 0}, {2, 2}, {2, 0}, {0, 1}, {-1, 5}, {-2, 0}, {3, -1}, {0, 3}}),
               std::invalid_argument);
}

TEST(ExtrusionMesh, IsClosedAndHasItsVolume) {
  const TriangleMesh ell = extrusion_mesh({{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 4}, {0, 4}}, -1, 1);
  EXPECT_TRUE(is_closed(ell));
  EXPECT_FALSE(is_convex(ell));
  EXPECT_NEAR(volume(ell), 2.0 * (3.0 + 3.0), 1e-12);
  EXPECT_NEAR(surface_area(ell), 2.0 * 6.0 + 2.0 * (3 + 1 + 2 + 3 + 1 + 4), 1e-12);
  EXPECT_THROW(extrusion_mesh({{0, 0}, {1, 0}, {0, 1}}, 1, 1), std::invalid_argument);
}

TEST(RevolutionMesh, HasTheVolumeOfItsRings) {
  // A cup: a cylinder of radius 2 and height 3 without one of radius 1 and height 2.
  const Polygon cup = {{0, 0}, {2, 0}, {2, 3}, {1, 3}, {1, 1}, {0, 1}};
  EXPECT_NEAR(revolution_moment(cup), 4.0 * 3.0 - 1.0 * 2.0, 1e-12);
  // A cone: base x height / 3.
  EXPECT_NEAR(revolution_moment({{0, 0}, {2, 0}, {0, 3}}), 4.0 * 3.0 / 3.0, 1e-12);
  for (const int sides : {3, 16, 400}) {
    const TriangleMesh mesh = revolution_mesh(cup, sides);
    EXPECT_TRUE(is_closed(mesh));
    EXPECT_NEAR(volume(mesh), sides / 2.0 * std::sin(2.0 * M_PI / sides) * revolution_moment(cup), 1e-11);
  }
  EXPECT_NEAR(volume(revolution_mesh(cup, 400)), M_PI * 10.0, 2e-3);  // 1 - sinc(2 pi / 400) is 4e-5
}

TEST(RevolutionMesh, SideZeroFacesX) {
  const TriangleMesh mesh = revolution_mesh({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, 8);
  EXPECT_NEAR(bounding_box(mesh).max.x(), std::cos(M_PI / 8), 1e-12);
}

TEST(RevolutionMesh, RefusesProfilesOffTheAxisOrInsideOut) {
  EXPECT_THROW(revolution_mesh({{1, 0}, {2, 0}, {2, 1}, {0, 1}}, 8), std::invalid_argument);
  EXPECT_THROW(revolution_mesh({{0, 1}, {1, 1}, {1, 0}, {0, 0}}, 8), std::invalid_argument);
  EXPECT_THROW(revolution_mesh({{0, 0}, {1, 0}, {0, 0.5}, {1, 1}, {0, 1}}, 8), std::invalid_argument);
  EXPECT_THROW(revolution_mesh({{0, 0}, {1, 0}, {0, 1}}, 2), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
