#include "stability/even_samples.h"

#include <cmath>
#include <map>
#include <stdexcept>

#include <gtest/gtest.h>

#include "stability/shape_families.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

// The smallest distance between two points, and the mean distance to the nearest other point.
struct Spacing {
  double least = 1e9, mean = 0.0;
};

Spacing spacing_of(const std::vector<SurfaceSample>& samples) {
  Spacing spacing;
  for (const SurfaceSample& s : samples) {
    double nearest = 1e9;
    for (const SurfaceSample& other : samples)
      if (&s != &other) nearest = std::min(nearest, (s.point - other.point).norm());
    spacing.least = std::min(spacing.least, nearest);
    spacing.mean += nearest / static_cast<double>(samples.size());
  }
  return spacing;
}

TEST(EvenSamples, AreAsManyAsAskedForAndLieOnTheSurface) {
  const Eigen::Vector3d edges(0.05, 0.08, 0.02);
  const TriangleMesh mesh = box_mesh(edges);
  for (const int count : {0, 1, 2, 7, 100, 1000}) {
    Rng rng = make_rng(1);
    const std::vector<SurfaceSample> samples = sample_surface_evenly(mesh, count, rng);
    ASSERT_EQ(samples.size(), static_cast<std::size_t>(count));
    for (const SurfaceSample& s : samples) {
      // On the face that the normal belongs to.
      EXPECT_NEAR(s.normal.dot(s.point), s.normal.cwiseAbs().dot(edges) / 2, 1e-12);
      EXPECT_LE((s.point.cwiseAbs() - edges / 2).maxCoeff(), 1e-12);
    }
  }
}

TEST(EvenSamples, KeepApartNearlyAsFarAsTheDensestPackingAllows) {
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = block_mesh(name);
    const double densest = densest_spacing(surface_area(mesh), 1000);
    Rng rng = make_rng(2);
    const Spacing even = spacing_of(sample_surface_evenly(mesh, 1000, rng));
    const Spacing uniform = spacing_of(sample_surface(mesh, 1000, rng));
    // Seen: 0.66 and 0.77 (Yuksel reports about 0.7 for the least distance on a plane). A uniform set's mean distance
    // to the nearest is 1 / (2 sqrt(density)) = 0.465 of the densest spacing, and its least one goes to 0.
    EXPECT_GT(even.least, 0.62 * densest) << name;
    EXPECT_LT(even.least, densest) << name;
    EXPECT_GT(even.mean, 0.73 * densest) << name;
    EXPECT_NEAR(uniform.mean / densest, 0.465, 0.04) << name;
    EXPECT_LT(uniform.least, 0.1 * densest) << name;
  }
}

TEST(EvenSamples, ShareThemselvesOutByArea) {
  // A box's faces, two of them close together: 1000 points, so uniform ones would vary by sqrt(n (1 - share)); even
  // ones by much less, but for what the rims, where distances are shorter than along the surface, take away.
  const Eigen::Vector3d edges(0.06, 0.08, 0.004);
  const TriangleMesh mesh = box_mesh(edges);
  std::map<int, double> count;  // by axis and side of the face
  constexpr int kRounds = 10, kPoints = 1000;
  for (int round = 0; round < kRounds; ++round) {
    Rng rng = make_rng(3, static_cast<std::uint64_t>(round));
    for (const SurfaceSample& s : sample_surface_evenly(mesh, kPoints, rng)) {
      int axis = 0;
      s.normal.cwiseAbs().maxCoeff(&axis);
      count[2 * axis + (s.normal[axis] > 0)] += 1.0 / kRounds;
    }
  }
  for (const auto& [face, seen] : count) {
    const double area = edges.prod() / edges[face / 2];
    const double expected = kPoints * area / surface_area(mesh);
    EXPECT_NEAR(seen, expected, face / 2 == 2 ? 0.03 * expected : 0.2 * expected) << "face " << face;
  }
}

TEST(EvenSamples, ComeBackFromTheirSeed) {
  Rng rng_a = make_rng(4), rng_b = make_rng(4), rng_c = make_rng(5);
  Rng shape_rng = make_rng(6);
  const TriangleMesh mesh = draw_shape(ShapeFamilyKind::kMug, shape_rng)->mesh;
  const auto a = sample_surface_evenly(mesh, 200, rng_a), b = sample_surface_evenly(mesh, 200, rng_b),
             c = sample_surface_evenly(mesh, 200, rng_c);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].point, b[i].point);
  EXPECT_NE(a[0].point, c[0].point);
}

TEST(EvenSamples, SlenderAndDistantMeshesDoAsWell) {
  Rng rng = make_rng(7);
  EXPECT_EQ(sample_surface_evenly(box_mesh({1e-5, 1e-5, 10.0}), 500, rng).size(), 500u);
  const auto far = sample_surface_evenly(translated(box_mesh({0.05, 0.05, 0.05}), {1e3, 0, 0}), 500, rng);
  EXPECT_GT(spacing_of(far).least, 0.62 * densest_spacing(6 * 0.05 * 0.05, 500));
}

TEST(EvenSamples, ASurfaceWithoutAreaIsRefused) {
  Rng rng = make_rng(8);
  EXPECT_THROW(sample_surface_evenly({{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}}, 10, rng), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
