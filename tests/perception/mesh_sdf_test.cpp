#include "perception/mesh_sdf.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "perception/winding_number.h"
#include "stability/random.h"
#include "stability/shape_families.h"
#include "stability/shapes.h"
#include "tests/sdf_points.h"

namespace dofusion {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Everything is computed in double from coordinates of some centimetres.
constexpr double kTolerance = 1e-12;

TriangleMesh sphere(double radius, int rings, int sectors) {
  TriangleMesh mesh;
  mesh.vertices.push_back({0, 0, radius});
  for (int r = 1; r < rings; ++r)
    for (int s = 0; s < sectors; ++s) {
      const double polar = kPi * r / rings, azimuth = 2 * kPi * s / sectors;
      mesh.vertices.push_back(radius * Eigen::Vector3d(std::sin(polar) * std::cos(azimuth),
                                                       std::sin(polar) * std::sin(azimuth), std::cos(polar)));
    }
  mesh.vertices.push_back({0, 0, -radius});
  const int last = static_cast<int>(mesh.vertices.size()) - 1;
  const auto index = [&](int r, int s) { return 1 + (r - 1) * sectors + s % sectors; };
  for (int s = 0; s < sectors; ++s) {
    mesh.triangles.push_back({0, index(1, s), index(1, s + 1)});
    for (int r = 1; r + 1 < rings; ++r) {
      mesh.triangles.push_back({index(r, s), index(r + 1, s), index(r + 1, s + 1)});
      mesh.triangles.push_back({index(r, s), index(r + 1, s + 1), index(r, s + 1)});
    }
    mesh.triangles.push_back({last, index(rings - 1, s + 1), index(rings - 1, s)});
  }
  return mesh;
}

Eigen::Vector3d random_point(Rng& rng, double size) {
  return {uniform(rng, -size, size), uniform(rng, -size, size), uniform(rng, -size, size)};
}

TEST(MeshSdf, BoxIsTheClosedForm) {
  const Eigen::Vector3d edges(0.05, 0.08, 0.02);
  const MeshSdf distance(box_mesh(edges));
  Rng rng = make_rng(1);
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 0.1);
    EXPECT_NEAR(distance(p), box_signed_distance(edges, p), kTolerance) << p.transpose();
  }
}

TEST(MeshSdf, AgreesWithComparingAllTrianglesOnEveryBlock) {
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = block_mesh(name);
    const MeshSdf fast(mesh);
    const MeshDistance plain(mesh);
    Rng rng = make_rng(2);
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d p = random_point(rng, 0.12);
      EXPECT_NEAR(fast(p), plain(p), kTolerance) << name << " at " << p.transpose();
    }
  }
}

TEST(MeshSdf, SignIsRightBesideCornersAndEdges) {
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = block_mesh(name);
    const MeshSdf distance(mesh);
    Rng rng = make_rng(3);
    std::vector<Eigen::Vector3d> features = mesh.vertices;
    for (const Eigen::Vector3i& t : mesh.triangles)
      for (int k = 0; k < 3; ++k) {
        const double s = uniform(rng);
        features.push_back(s * mesh.vertices[t[k]] + (1.0 - s) * mesh.vertices[t[(k + 1) % 3]]);
      }
    for (const Eigen::Vector3d& feature : features)
      for (int i = 0; i < 50; ++i) {
        const Eigen::Vector3d p = feature + random_point(rng, 1e-4);
        if (std::abs(distance(p)) < 1e-9) continue;  // on the surface the winding number has no value
        EXPECT_EQ(distance(p) < 0.0, plain_winding_number(mesh, p) > 0.5) << name << " at " << p.transpose();
      }
    EXPECT_GT(distance(Eigen::Vector3d(0, 0, 1)), 0.0) << name;
    EXPECT_LT(distance(Eigen::Vector3d::Zero()), 0.0) << name << ": its centre of mass is inside, it is convex";
  }
}

TEST(MeshSdf, SignIsRightInTheNotchOfAConcaveSolid) {
  // An L: a point in the notch is outside although it is inside the convex hull, and the concave edge is nearest to
  // points inside the solid.
  TriangleMesh mesh;
  const std::vector<Eigen::Vector2d> outline{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  const std::vector<Eigen::Vector3i> caps{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
  const int n = static_cast<int>(outline.size());
  for (double z : {0.0, 1.0})
    for (const Eigen::Vector2d& p : outline) mesh.vertices.push_back({p.x(), p.y(), z});
  for (const Eigen::Vector3i& t : caps) {
    mesh.triangles.push_back({t[0], t[2], t[1]});
    mesh.triangles.push_back(t + Eigen::Vector3i::Constant(n));
  }
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    mesh.triangles.push_back({i, j, j + n});
    mesh.triangles.push_back({i, j + n, i + n});
  }
  ASSERT_TRUE(is_closed(mesh));
  ASSERT_NEAR(volume(mesh), 3.0, 1e-12);
  const MeshSdf distance(mesh);
  EXPECT_NEAR(distance({1.2, 1.3, 0.5}), 0.2, kTolerance);
  EXPECT_NEAR(distance({0.9, 0.9, 0.5}), -std::sqrt(0.02), kTolerance);  // the concave edge is nearest
  Rng rng = make_rng(4);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 2.5);
    EXPECT_EQ(distance(p) < 0.0, plain_winding_number(mesh, p) > 0.5) << p.transpose();
  }
}

TEST(MeshSdf, FineSphereIsASphere) {
  const double radius = 0.04;
  const TriangleMesh mesh = sphere(radius, 100, 200);
  const Eigen::Vector3d centre(3.0, -2.0, 1.0);  // far from the origin, where floats are coarse
  const MeshSdf distance(translated(mesh, centre));
  // A facet of angle a lies up to r a^2 / 8 below the sphere, a = 2 pi / 200 along both directions.
  const double sagitta = 2.0 * radius * std::pow(2.0 * kPi / 200, 2) / 8.0;
  const MeshDistance plain(mesh);
  Rng rng = make_rng(5);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 0.1);
    const double d = distance(centre + p);
    EXPECT_GE(d, p.norm() - radius - kTolerance);
    EXPECT_LE(d, p.norm() - radius + sagitta);
    if (i < 20) {
      EXPECT_NEAR(d, plain(p), kTolerance);  // slow, so only a few
    }
  }
}

TEST(MeshSdf, GridInterpolatesTheDistance) {
  const TriangleMesh mesh = block_mesh("hat");
  const SdfGrid grid = mesh_to_sdf_grid(mesh);
  const MeshDistance distance(mesh);
  Rng rng = make_rng(6);
  const double size = bounding_box(mesh).max.maxCoeff();
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 1.5 * size);
    // A distance has slope 1: interpolation errs by less than half a cell's diagonal, with the float's rounding.
    EXPECT_NEAR(grid(p), distance(p), 0.5 * std::sqrt(3.0) * grid.spacing + 1e-8);
  }
}

TEST(MeshSdf, ManyPointsAtOnceAreThoseOneByOneOnAnyNumberOfThreads) {
  Rng rng = make_rng(7);
  const TriangleMesh mesh = with_longest_edge_halved(draw_shape(ShapeFamilyKind::kMug, rng)->mesh);
  const MeshSdf distance(mesh);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 5000; ++i) points.push_back(random_point(rng, 0.1));
  const std::vector<double> one = distance.distances(points, 1), three = distance.distances(points, 3);
  EXPECT_EQ(one, three);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_NEAR(one[i], distance(points[i]), kTolerance);
  EXPECT_TRUE(distance.distances({}, 2).empty());
}

TEST(MeshSdf, NoSignIsWrongNearEdgesAndCornersOfTheBlocks) {
  constexpr int kPointsABlock = 15000;  // sdf_bench --check takes ten times as many
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = block_mesh(name);
    const std::vector<HalfSpace> planes = half_spaces(mesh);
    Rng rng = make_rng(8);
    const std::vector<Eigen::Vector3d> points = points_near_edges(mesh, kPointsABlock, rng);
    const std::vector<double> distances = MeshSdf(mesh).distances(points);
    int wrong = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      // Within a few roundings of the surface neither side is certain.
      if (std::abs(distances[i]) > 1e-15) wrong += (distances[i] < 0) != inside_half_spaces(planes, points[i]);
    }
    EXPECT_EQ(wrong, 0) << name;
  }
}

TEST(MeshSdf, NoSignIsWrongNearEdgesAndCornersOfHollowShapes) {
  for (const ShapeFamilyKind kind :
       {ShapeFamilyKind::kEll, ShapeFamilyKind::kArch, ShapeFamilyKind::kMug, ShapeFamilyKind::kBowl}) {
    Rng rng = make_rng(9);
    const TriangleMesh mesh = draw_shape(kind, rng)->mesh;
    const std::vector<Eigen::Vector3d> points = points_near_edges(mesh, 5000, rng);
    const std::vector<double> distances = MeshSdf(mesh).distances(points);
    int wrong = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (std::abs(distances[i]) > 1e-12) wrong += (distances[i] < 0) != (plain_winding_number(mesh, points[i]) > 0.5);
    EXPECT_EQ(wrong, 0) << to_string(kind);
  }
}

TEST(MeshSdf, FarPointsAndSuchThatAreNotFinite) {
  const MeshSdf distance(box_mesh({2, 2, 2}));
  EXPECT_NEAR(distance({1e9, 0, 0}) / (1e9 - 1), 1.0, 1e-15);
  EXPECT_NEAR(distance({0, 1e30, 0}) / 1e30, 1.0, 1e-15);
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  const std::vector<double> bad = distance.distances({{nan, 0, 0}, {0, 0, 3}, {0, -infinity, 0}});
  EXPECT_TRUE(std::isnan(bad[0]));
  EXPECT_NEAR(bad[1], 2.0, kTolerance);
  EXPECT_TRUE(std::isnan(bad[2]));
}

// A fine sphere without the triangles within `radius` of its north pole.
TriangleMesh sphere_with_hole(double hole_radius) {
  TriangleMesh mesh = sphere(1.0, 40, 80);
  const auto gone = [&](const Eigen::Vector3i& t) {
    return (mesh.vertices[t[0]] - Eigen::Vector3d::UnitZ()).norm() < hole_radius;
  };
  mesh.triangles.erase(std::remove_if(mesh.triangles.begin(), mesh.triangles.end(), gone), mesh.triangles.end());
  return mesh;
}

TEST(MeshSdf, ASmallHoleLeavesTheSignRightAwayFromIt) {
  const TriangleMesh mesh = sphere_with_hole(0.3);
  const MeshSdf distance(mesh);
  EXPECT_FALSE(distance.watertight());
  EXPECT_EQ(distance.open_edges(), 80u);
  EXPECT_TRUE(MeshSdf(sphere(1.0, 40, 80)).watertight());
  Rng rng = make_rng(10);
  int seen = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 1.5);
    const double depth = p.norm() - 1.0;
    if (std::abs(depth) < 0.01 || (p - Eigen::Vector3d::UnitZ()).norm() < 0.4) continue;
    EXPECT_EQ(distance(p) < 0, depth < 0) << p.transpose();
    ++seen;
  }
  EXPECT_GT(seen, 15000);
  // Close to the surface that is there the sign is right up to the hole's rim.
  for (const SurfaceSample& s : sample_surface(mesh, 5000, rng)) {
    EXPECT_GT(distance(s.point + 1e-4 * s.normal), 0.0);
    EXPECT_LT(distance(s.point - 1e-4 * s.normal), 0.0);
  }
}

TEST(MeshSdf, ACubeWithoutATriangleStillHasAnInside) {
  TriangleMesh open = box_mesh({1, 1, 1});
  open.triangles.pop_back();
  const MeshSdf distance(open);
  EXPECT_EQ(distance.open_edges(), 3u);
  EXPECT_NEAR(distance({0.1, 0.05, 0.0}), -0.4, 0.11);  // to whichever face is there
  EXPECT_LT(distance({0.0, 0.0, 0.0}), 0.0);
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.6, 0.1, 0.2), Eigen::Vector3d(-0.6, 0.1, 0.2),
                                   Eigen::Vector3d(0.1, 0.9, 0.2), Eigen::Vector3d(0.1, 0.2, -0.9)})
    EXPECT_GT(distance(p), 0.0);
}

TEST(MeshSdf, WhatIsClearlyOpenOrHasNoInsideIsRefused) {
  EXPECT_THROW(MeshSdf{TriangleMesh{}}, std::invalid_argument);
  const auto top = [](const TriangleMesh& mesh, double height) {  // what lies below it
    TriangleMesh part{mesh.vertices, {}};
    for (const Eigen::Vector3i& t : mesh.triangles)
      if (std::max({mesh.vertices[t[0]].z(), mesh.vertices[t[1]].z(), mesh.vertices[t[2]].z()}) < height)
        part.triangles.push_back(t);
    return part;
  };
  EXPECT_THROW(MeshSdf{top(sphere(1.0, 40, 80), 0.0)}, std::invalid_argument) << "half a sphere";
  EXPECT_THROW(MeshSdf{top(sphere(1.0, 40, 80), 0.6)}, std::invalid_argument) << "a cup of no thickness";
  const TriangleMesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  EXPECT_THROW(MeshSdf{sheet}, std::invalid_argument);
  TriangleMesh flipped = box_mesh({1, 1, 1});
  std::swap(flipped.triangles[0][0], flipped.triangles[0][1]);
  EXPECT_THROW(MeshSdf{flipped}, std::invalid_argument);
}

TEST(MeshSdf, AGridIsTheSameOnAnyNumberOfThreadsAndNearTheExactDistance) {
  Rng rng = make_rng(11);
  const TriangleMesh mesh = draw_shape(ShapeFamilyKind::kMug, rng)->mesh;
  const SdfGrid grid = mesh_to_sdf_grid(mesh, {}, 1);
  EXPECT_EQ(grid.values, mesh_to_sdf_grid(mesh, {}, 3).values);
  const MeshSdf distance(mesh);
  const std::vector<Eigen::Vector3d> nodes = node_positions(grid);
  for (std::size_t i = 0; i < nodes.size(); i += 97) EXPECT_NEAR(grid.values[i], distance(nodes[i]), 1e-7);
  // The bound of the declaration, and what is usual: edges and the middle of thin walls are where it errs most.
  std::vector<double> errors;
  for (const SurfaceSample& s : sample_surface(mesh, 4000, rng)) {
    const Eigen::Vector3d p = s.point + normal3(rng, grid.spacing);
    errors.push_back(std::abs(grid(p) - distance(p)));
    EXPECT_LE(errors.back(), 0.5 * std::sqrt(3.0) * grid.spacing + 1e-7);
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.1 * grid.spacing);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.4 * grid.spacing);
}

TEST(WindingNumber, IsThatOfAllTrianglesWithinItsError) {
  for (const TriangleMesh& mesh : {sphere(1.0, 40, 80), sphere_with_hole(0.4)}) {
    const WindingNumber fast(mesh);
    Rng rng = make_rng(12);
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d p = random_point(rng, 1.5);
      EXPECT_NEAR(fast(p), plain_winding_number(mesh, p), 0.02) << p.transpose();
    }
  }
}

}  // namespace
}  // namespace dofusion
