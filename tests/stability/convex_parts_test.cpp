#include "stability/convex_parts.h"

#include <chrono>
#include <cmath>

#include <gtest/gtest.h>

#include "stability/convex_hull.h"
#include "stability/mesh_rays.h"
#include "stability/random.h"
#include "stability/shapes.h"
#include "stability/swept_mesh.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

TriangleMesh turned(TriangleMesh mesh, const Eigen::Matrix3d& R) {
  for (Vector3d& v : mesh.vertices) v = R * v;
  return mesh;
}

TriangleMesh joined(TriangleMesh a, const TriangleMesh& b) {
  const Eigen::Vector3i first = Eigen::Vector3i::Constant(static_cast<int>(a.vertices.size()));
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Eigen::Vector3i& t : b.triangles) a.triangles.push_back(t + first);
  return a;
}

TriangleMesh inside_out(TriangleMesh mesh) {
  for (Eigen::Vector3i& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

TriangleMesh ell() { return extrusion_mesh({{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 4}, {0, 4}}, -1, 1); }
TriangleMesh tee() { return extrusion_mesh({{1, 0}, {2, 0}, {2, 3}, {4, 3}, {4, 4}, {-1, 4}, {-1, 3}, {1, 3}}, -1, 1); }
TriangleMesh arch() { return extrusion_mesh({{0, 0}, {1, 0}, {1, 2}, {3, 2}, {3, 0}, {4, 0}, {4, 3}, {0, 3}}, -1, 1); }

// A ring about z of radius 1 and the given thickness radius, in 2n sections of n corners.
TriangleMesh torus(int n, double thickness) {
  TriangleMesh mesh;
  for (int i = 0; i < 2 * n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double a = M_PI * i / n, b = 2.0 * M_PI * j / n, r = 1.0 + thickness * std::cos(b);
      mesh.vertices.emplace_back(r * std::cos(a), r * std::sin(a), thickness * std::sin(b));
    }
  }
  const auto corner = [n](int i, int j) { return i % (2 * n) * n + j % n; };
  for (int i = 0; i < 2 * n; ++i) {
    for (int j = 0; j < n; ++j) {
      mesh.triangles.emplace_back(corner(i, j), corner(i + 1, j), corner(i + 1, j + 1));
      mesh.triangles.emplace_back(corner(i, j), corner(i + 1, j + 1), corner(i, j + 1));
    }
  }
  return mesh;
}

double sum_of_volumes(const std::vector<TriangleMesh>& parts) {
  double sum = 0.0;
  for (const TriangleMesh& part : parts) sum += volume(part);
  return sum;
}

void expect_sound(const std::vector<TriangleMesh>& parts, const ConvexPartsOptions& options = {}) {
  EXPECT_LE(static_cast<int>(parts.size()), options.max_parts);
  for (const TriangleMesh& part : parts) {
    EXPECT_TRUE(is_closed(part));
    EXPECT_TRUE(is_convex(part, 1e-7));
    EXPECT_LE(static_cast<int>(part.vertices.size()), options.max_corners);
  }
}

TEST(MeshRays, CrossABoxWhereItsFacesAre) {
  const MeshRays rays(translated(box_mesh({2, 4, 6}), {10, 0, 0}));
  for (const auto& [y, z] :
       {std::pair(0.3, 0.7), std::pair(0.0, 0.0), std::pair(-1.99, 2.99)}) {  // the second on an edge
    const auto crossings = rays.along_x(y, z);
    ASSERT_EQ(crossings.size(), 2u);
    EXPECT_NEAR(crossings[0].x, 9.0, 1e-12);
    EXPECT_NEAR(crossings[1].x, 11.0, 1e-12);
    EXPECT_EQ(crossings[0].change, 1);
    EXPECT_EQ(crossings[1].change, -1);
  }
  EXPECT_TRUE(rays.along_x(2.01, 0).empty());
  EXPECT_TRUE(rays.inside({10, 0, 0}));
  EXPECT_FALSE(rays.inside({8.9, 0, 0}));
  EXPECT_FALSE(rays.inside({11.1, 0, 0}));
}

TEST(MeshRays, EnterAsOftenAsTheyLeave) {
  Rng rng = make_rng(1);
  const MeshRays rays(torus(24, 0.3));
  for (int i = 0; i < 2000; ++i) {
    // Half of the lines run through corners of the grid of triangles.
    const double y = i % 2 == 0 ? uniform(rng, -1.3, 1.3) : 1.3 * std::sin(M_PI * (i % 48) / 24);
    const double z = i % 2 == 0 ? uniform(rng, -0.3, 0.3) : 0.3 * std::sin(2.0 * M_PI * (i / 48) / 24);
    int solids = 0;
    for (const RayCrossing& c : rays.along_x(y, z)) solids += c.change;
    EXPECT_EQ(solids, 0) << y << ", " << z;
  }
}

TEST(ConvexParts, SolidsOfBoxesComeApartExactlyHoweverTheyAreTurned) {
  Rng rng = make_rng(2);
  const std::vector<std::pair<TriangleMesh, std::size_t>> solids = {{ell(), 2}, {tee(), 2}, {arch(), 3}};
  for (const auto& [mesh, count] : solids) {
    for (int trial = 0; trial < 5; ++trial) {
      const Eigen::Matrix3d R = trial == 0 ? Eigen::Matrix3d::Identity() : random_rotation(rng);
      const TriangleMesh solid = translated(turned(mesh, R), {5, -7, 3});
      const auto parts = convex_parts(solid);
      expect_sound(parts);
      EXPECT_EQ(parts.size(), count);
      EXPECT_NEAR(sum_of_volumes(parts) / volume(mesh), 1.0, 1e-9);
      const ConvexFit fit = convex_fit(solid, parts, 32);
      EXPECT_LT(fit.added, 1e-9);
      EXPECT_LT(fit.missing, 1e-9);
    }
  }
}

TEST(ConvexParts, AConvexSolidStaysOnePart) {
  for (const TriangleMesh& mesh : {box_mesh({1, 2, 3}), block_mesh("hat"), cylinder_mesh(1, 2)}) {
    ConvexPartsOptions options;
    options.max_corners = 200;
    const auto parts = convex_parts(mesh, options);
    ASSERT_EQ(parts.size(), 1u);
    EXPECT_NEAR(volume(parts[0]) / volume(mesh), 1.0, 1e-9);
  }
}

TEST(ConvexParts, ShellsApartAndCavitiesAreFollowed) {
  const TriangleMesh apart = joined(box_mesh({1, 1, 1}), translated(box_mesh({1, 2, 1}), {3, 0, 0}));
  const auto two = convex_parts(apart);
  EXPECT_EQ(two.size(), 2u);
  EXPECT_NEAR(sum_of_volumes(two), 3.0, 1e-9);
  const TriangleMesh hollow = joined(box_mesh({3, 3, 3}), inside_out(box_mesh({1, 1, 1})));
  ConvexPartsOptions exact;
  exact.tolerance = 1e-6;
  const auto walls = convex_parts(hollow, exact);
  expect_sound(walls);
  EXPECT_GE(walls.size(), 6u);  // a slab below, one above, and four walls
  EXPECT_LE(walls.size(), 12u);
  EXPECT_NEAR(sum_of_volumes(walls), 26.0, 1e-8);
}

TEST(ConvexParts, ExcessStaysWithinTheToleranceAndShrinksWithMoreParts) {
  const TriangleMesh ring = torus(24, 0.25);
  double before = 1.0;
  for (const int most : {2, 4, 8, 16, 32}) {
    ConvexPartsOptions options;
    options.max_parts = most;
    options.max_corners = 1000;
    const auto parts = convex_parts(ring, options);
    expect_sound(parts, options);
    const ConvexFit fit = convex_fit(ring, parts);
    EXPECT_LT(fit.missing, 1e-6);  // hulls hold what they are hulls of
    EXPECT_LT(fit.added, before + 1e-6);
    before = fit.added;
  }
  EXPECT_LT(before, 0.012);  // the tolerance is 0.01 in volumes, measured along lines
  ConvexPartsOptions coarse;
  coarse.tolerance = 0.1;
  EXPECT_LT(convex_parts(ring, coarse).size(), convex_parts(ring).size());
  EXPECT_LT(convex_fit(ring, convex_parts(ring, coarse)).added, 0.1);
}

TEST(ConvexParts, OfABowlLeaveItHollow) {
  const TriangleMesh bowl = revolution_mesh({{0, 0}, {0.5, 0}, {1, 0.7}, {0.9, 0.7}, {0.45, 0.12}, {0, 0.12}}, 32);
  const auto parts = convex_parts(bowl);
  expect_sound(parts);
  // The walls are a tenth as thick as the bowl is wide, and hulls of 32 pieces of a ring bulge inwards.
  const ConvexFit fit = convex_fit(bowl, parts);
  EXPECT_LT(fit.added, 0.12);
  EXPECT_LT(fit.missing, 0.005);
  // A ball in the middle touches none of them.
  for (const TriangleMesh& part : parts) {
    for (const Vector3d& v : part.vertices) EXPECT_GT((v - Vector3d(0, 0, 0.6)).norm(), 0.4);
  }
}

TEST(ConvexParts, AreTheSameEachTime) {
  const TriangleMesh ring = torus(16, 0.3);
  const auto once = convex_parts(ring), again = convex_parts(ring);
  ASSERT_EQ(once.size(), again.size());
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].vertices, again[i].vertices);
    EXPECT_EQ(once[i].triangles, again[i].triangles);
  }
}

TEST(ConvexParts, SizeAndPlaceDoNotMatter) {
  for (const double scale : {1e-4, 1e4}) {
    const auto parts =
        convex_parts(translated(scaled(arch(), Vector3d::Constant(scale)), Vector3d::Constant(100 * scale)));
    EXPECT_EQ(parts.size(), 3u);
    EXPECT_NEAR(sum_of_volumes(parts) / (scale * scale * scale) / volume(arch()), 1.0, 1e-6);
  }
}

TEST(ConvexParts, OfAHundredThousandTrianglesTakeSeconds) {
  const TriangleMesh ring = torus(160, 0.25);
  ASSERT_GT(ring.triangles.size(), 100000u);
  const auto start = std::chrono::steady_clock::now();
  const auto parts = convex_parts(ring);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_LT(seconds, 60.0);  // 6 s where nothing else runs
  expect_sound(parts);
  const ConvexFit fit = convex_fit(ring, parts);
  EXPECT_LT(fit.added, 0.02);
  EXPECT_LT(fit.missing, 0.03);  // 64 corners a part
}

TEST(ConvexParts, RefuseOpenAndInsideOutMeshesAndBadOptions) {
  TriangleMesh open = ell();
  open.triangles.pop_back();
  EXPECT_THROW(convex_parts(open), std::invalid_argument);
  EXPECT_THROW(convex_parts({}), std::invalid_argument);
  EXPECT_THROW(convex_parts(inside_out(ell())), std::invalid_argument);
  ConvexPartsOptions options;
  options.max_parts = 0;
  EXPECT_THROW(convex_parts(ell(), options), std::invalid_argument);
  options = {};
  options.max_corners = 4;
  EXPECT_THROW(convex_parts(ell(), options), std::invalid_argument);
  options = {};
  options.tolerance = -1;
  EXPECT_THROW(convex_parts(ell(), options), std::invalid_argument);
}

TEST(ConvexFit, TellsWhatIsAddedAndWhatIsMissing) {
  const TriangleMesh box = box_mesh({2, 2, 2});  // the parts reach 1 beyond it and leave a quarter of it out
  const ConvexFit fit =
      convex_fit(box, {translated(box_mesh({1.5, 2, 2}), {0.25, 0, 0}), translated(box_mesh({2, 2, 1}), {0, 0, 1.5})},
                 66);  // lines a side, a multiple of 3: a third of them pass above the box
  EXPECT_NEAR(fit.missing, 0.25, 1e-9);
  EXPECT_NEAR(fit.added, 0.5, 1e-9);
  EXPECT_NEAR(convex_fit(box, {}).missing, 1.0, 1e-12);
}

TEST(ConvexHull, LeavesOutWhatIsNoFartherOutThanItsFlatness) {
  // Turned, as the outermost points along the axes are always taken.
  Rng rng = make_rng(5);
  const Eigen::Matrix3d R = random_rotation(rng);
  std::vector<Vector3d> points = turned(box_mesh({2, 2, 2}), R).vertices;
  points.push_back(R * Vector3d(0.1, 0.2, 1.0 + 1e-4));
  EXPECT_EQ(convex_hull(points, {0, 1e-3}).vertices.size(), 8u);
  EXPECT_EQ(convex_hull(points, {0, 1e-5}).vertices.size(), 9u);
}

TEST(ConvexHull, OfFewerCornersLiesInsideTheExactOne) {
  const TriangleMesh ball = sphere_mesh(1.0);
  double before = 0.0;
  for (const int corners : {5, 8, 16, 64, 256}) {
    const TriangleMesh hull = convex_hull(ball.vertices, {corners, 0.0});
    EXPECT_LE(static_cast<int>(hull.vertices.size()), corners);
    EXPECT_TRUE(is_closed(hull));
    EXPECT_GT(volume(hull), before);
    EXPECT_LT(volume(hull), volume(ball) + 1e-12);
    before = volume(hull);
  }
  EXPECT_GT(before, 0.95 * volume(ball));
  EXPECT_EQ(convex_hull(box_mesh({1, 2, 3}).vertices, {64, 0.0}).vertices.size(), 8u);
}

}  // namespace
}  // namespace dofusion
