#include "stability/point_tree.h"

#include <chrono>

#include <gtest/gtest.h>

#include "stability/mesh.h"
#include "stability/random.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

double brute_force_diameter(const Points& points) {
  double squared = 0.0;
  for (const Vector3d& a : points) {
    for (const Vector3d& b : points) squared = std::max(squared, (a - b).squaredNorm());
  }
  return std::sqrt(squared);
}

Points gaussian_cloud(int count, const Vector3d& sigmas, Rng& rng) {
  Points points;
  for (int i = 0; i < count; ++i) points.push_back(normal3(rng).cwiseProduct(sigmas));
  return points;
}

Points sphere_cloud(int count, Rng& rng) {
  Points points;
  for (int i = 0; i < count; ++i) points.push_back(normal3(rng).normalized());
  return points;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

TEST(PointTree, DiameterIsThatOfAllPairs) {
  Rng rng = make_rng(1);
  for (const Vector3d& sigmas : {Vector3d(1, 1, 1), Vector3d(1, 1, 0), Vector3d(1, 0, 0), Vector3d(100, 1, 0.01)}) {
    for (const int count : {2, 3, 17, 500}) {
      Points points = gaussian_cloud(count, sigmas, rng);
      EXPECT_EQ(PointTree(points).diameter(), brute_force_diameter(points)) << sigmas.transpose() << ", " << count;
      const Eigen::Matrix3d R = random_rotation(rng);
      for (Vector3d& p : points) p = R * p + Vector3d(1e3, -2e3, 5e2);  // far from the origin
      EXPECT_EQ(PointTree(points).diameter(), brute_force_diameter(points)) << sigmas.transpose() << ", " << count;
    }
  }
  const Points sphere = sphere_cloud(3000, rng);
  EXPECT_EQ(PointTree(sphere).diameter(), brute_force_diameter(sphere));
  const Points even = sphere_mesh(1.0).vertices;  // a thousand pairs that are equally far apart
  EXPECT_EQ(PointTree(even).diameter(), brute_force_diameter(even));
}

TEST(PointTree, DiameterOfNextToNothing) {
  EXPECT_EQ(PointTree({}).diameter(), 0.0);
  EXPECT_EQ(PointTree({{1, 2, 3}}).diameter(), 0.0);
  EXPECT_EQ(PointTree(Points(1000, {1, 2, 3})).diameter(), 0.0);
  EXPECT_EQ(PointTree({{0, 0, 0}, {3, 4, 0}}).diameter(), 5.0);
}

// All pairs of 10^5 points would take a minute. The bounds are many times what is needed.
TEST(PointTree, DiameterOfVeryManyPointsTakesNoTime) {
  Rng rng = make_rng(2);
  const Points sphere = sphere_cloud(100000, rng);
  auto start = std::chrono::steady_clock::now();
  EXPECT_NEAR(PointTree(sphere).diameter(), 2.0, 1e-3);
  EXPECT_LT(seconds_since(start), 1.0);

  // Two parallel disks far apart: all pairs between them are nearly as far apart.
  Points rod;
  const Eigen::Matrix3d R = random_rotation(rng);
  for (int i = 0; i < 100000; ++i) {
    const double r = std::sqrt(uniform(rng)), angle = uniform(rng, 0.0, 2.0 * M_PI);
    rod.push_back(R * Vector3d(r * std::cos(angle), r * std::sin(angle), i % 2 == 0 ? -500.0 : 500.0));
  }
  start = std::chrono::steady_clock::now();
  EXPECT_NEAR(PointTree(rod).diameter(), std::hypot(1000.0, 2.0), 1e-4);
  EXPECT_LT(seconds_since(start), 2.0);
}

TEST(PointTree, FindsWhatLiesBeyondAPlane) {
  Rng rng = make_rng(3);
  const Points points = gaussian_cloud(2000, {1, 2, 3}, rng);
  const PointTree tree(points);
  for (int i = 0; i < 200; ++i) {
    const Vector3d normal = normal3(rng).normalized();
    double farthest = -1e300;
    for (const Vector3d& p : points) farthest = std::max(farthest, normal.dot(p));
    EXPECT_TRUE(tree.any_beyond(normal, farthest - 1e-9));
    EXPECT_FALSE(tree.any_beyond(normal, farthest));
  }
  EXPECT_FALSE(PointTree({}).any_beyond(Vector3d::UnitX(), -1.0));
}

// A cube whose faces are grids of n x n squares, turned: many triangles in one plane.
TriangleMesh fine_cube(int n, const Eigen::Matrix3d& R) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const int first = static_cast<int>(mesh.vertices.size());
      for (int i = 0; i <= n; ++i) {
        for (int j = 0; j <= n; ++j) {
          Vector3d v;
          v[axis] = side;
          v[(axis + 1) % 3] = 2.0 * i / n - 1.0;
          v[(axis + 2) % 3] = 2.0 * j / n - 1.0;
          mesh.vertices.push_back(R * v);
        }
      }
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          const int a = first + i * (n + 1) + j, b = a + n + 1, c = b + 1, d = a + 1;
          if (side > 0) {
            mesh.triangles.insert(mesh.triangles.end(), {{a, b, c}, {a, c, d}});
          } else {
            mesh.triangles.insert(mesh.triangles.end(), {{a, c, b}, {a, d, c}});
          }
        }
      }
    }
  }
  return mesh;
}

TEST(PointTree, MeshesOfAMillionTrianglesAreLookedAtInSeconds) {
  Rng rng = make_rng(4);
  TriangleMesh cube = fine_cube(289, random_rotation(rng));
  ASSERT_GT(cube.triangles.size(), 1000000u);
  auto start = std::chrono::steady_clock::now();
  EXPECT_TRUE(is_convex(cube));
  EXPECT_LT(seconds_since(start), 10.0);
  start = std::chrono::steady_clock::now();
  EXPECT_NEAR(diameter(cube), std::sqrt(12.0), 1e-9);
  EXPECT_LT(seconds_since(start), 5.0);
  // Neighbouring faces share their corners to the last digit only where they are not turned.
  const TriangleMesh straight = fine_cube(289, Eigen::Matrix3d::Identity());
  start = std::chrono::steady_clock::now();
  EXPECT_TRUE(is_closed(straight));
  EXPECT_LT(seconds_since(start), 10.0);
  cube.vertices[cube.vertices.size() / 2] *= 0.98;  // a dent deeper than the tolerance
  EXPECT_FALSE(is_convex(cube));
}

}  // namespace
}  // namespace dofusion
