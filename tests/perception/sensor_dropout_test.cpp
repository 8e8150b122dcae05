// Readings that a sensor does not give, or that lie beside the surface: holes, grazing rays, edges.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/perception/plane_scans.h"

namespace dofusion {
namespace {

TEST(SensorDropout, HolesTakeTheirShareInBlobs) {
  const Scan scan = plane_scan(1.0);
  SensorTerms terms;
  terms.hole_share = 0.05;
  terms.hole_length_px = 4.0;
  Rng rng = make_rng(17);
  double missing = 0.0, beside = 0.0;
  constexpr int kImages = 40;
  for (int image = 0; image < kImages; ++image) {
    const DepthImage noisy = apply_sensor_noise(scan, kCamera, terms, 1.0, rng);
    for (int v = 0; v < 200; ++v)
      for (int u = 0; u + 1 < 200; ++u) {
        if (noisy.at(v, u) > 0.0f) {
          EXPECT_EQ(noisy.at(v, u), scan.depth.at(v, u));  // outside of holes nothing changes
          continue;
        }
        ++missing;
        beside += noisy.at(v, u + 1) == 0.0f;
      }
  }
  // As many independent pixels as blobs of 2 pi 4^2 = 100: 16,000.
  EXPECT_NEAR(missing / (kImages * 200 * 199), 0.05, 5.0 * std::sqrt(0.05 * 0.95 / 16000.0));
  EXPECT_GT(beside / missing, 0.8) << "a hole's pixels lie together";
}

TEST(SensorDropout, GrazingSurfacesGiveNoReading) {
  Rng rng = make_rng(10);
  // The camera sees 18 degrees across: of a plane tilted by 80 degrees incidences from 70.6 to 89.4.
  const Scan scan = plane_scan(1.0, 80 * kDegree);
  const DepthImage noisy = apply_sensor_noise(scan, kCamera, SensorModel::kRealsense, 1.0, rng);
  for (int v = 0; v < 200; ++v)
    for (int u = 0; u < 200; ++u) {
      const double from_grazing = 90.0 - incidence_angle(scan, kCamera, v, u) / kDegree;
      if (std::abs(from_grazing - 8.0) < 1e-3) continue;  // floats
      EXPECT_EQ(noisy.at(v, u) == 0.0f, from_grazing < 8.0) << u << ", " << v;
    }
}

TEST(SensorDropout, IncidenceDropsItsShare) {
  SensorTerms terms;
  terms.incidence_drop = 1.0;
  const Scan scan = plane_scan(1.0, 60 * kDegree);
  double expected = 0.0;
  for (int v = 0; v < 200; ++v)
    for (int u = 0; u < 200; ++u) expected += 1.0 - std::cos(incidence_angle(scan, kCamera, v, u));
  Rng rng = make_rng(11);
  const Errors e = errors(apply_sensor_noise(scan, kCamera, terms, 1.0, rng), scan);
  EXPECT_NEAR(e.missing, expected, count_tolerance(expected / kPixels, kPixels));
  EXPECT_NEAR(e.sigma, 0.0, 1e-6);  // what is left is exact
}

TEST(SensorDropout, EdgesAreWhereDepthSteps) {
  const Scan scan = step_scan(0.6, 0.7);
  EXPECT_FALSE(depth_across_edge(scan, kCamera, 50, 98));
  EXPECT_FALSE(depth_across_edge(scan, kCamera, 50, 101));
  EXPECT_NEAR(*depth_across_edge(scan, kCamera, 50, 99), 0.7, 1e-6);
  EXPECT_NEAR(*depth_across_edge(scan, kCamera, 50, 100), 0.6, 1e-6);
  EXPECT_FALSE(depth_across_edge(step_scan(0.695, 0.7), kCamera, 50, 99)) << "5 mm are below the threshold";
  // A steep plane changes by centimetres a pixel and has no edge.
  const Scan steep = plane_scan(2.0, 75 * kDegree);
  EXPECT_GT(std::abs(steep.depth.at(50, 101) - steep.depth.at(50, 100)), kEdgeStep);
  for (int u = 0; u < 200; ++u) EXPECT_FALSE(depth_across_edge(steep, kCamera, 50, u)) << u;
  // Beside nothing there is no depth to fly to.
  Scan hole = plane_scan(1.0);
  hole.depth.at(50, 50) = 0.0f;
  EXPECT_EQ(depth_across_edge(hole, kCamera, 50, 49), 0.0);
}

TEST(SensorDropout, EdgePixelsDropOrFlyInsideTheStep) {
  const Scan scan = step_scan(0.6, 0.9);
  SensorTerms terms;
  terms.edge_drop = 0.2;
  terms.edge_fly = 0.5;
  int dropped = 0, flying = 0, pixels = 0;
  double sum = 0.0;
  Rng rng = make_rng(12);
  for (int image = 0; image < 10; ++image) {
    const DepthImage noisy = apply_sensor_noise(scan, kCamera, terms, 1.0, rng);
    for (int v = 0; v < 200; ++v)
      for (int u = 0; u < 200; ++u) {
        const float z = noisy.at(v, u);
        if (u < 99 || u > 100) {
          ASSERT_EQ(z, scan.depth.at(v, u));
          continue;
        }
        ++pixels;
        dropped += z == 0.0f;
        if (z == 0.0f || z == scan.depth.at(v, u)) continue;
        ASSERT_TRUE(z >= 0.6f && z <= 0.9f) << z;
        ++flying;
        sum += z;
      }
  }
  EXPECT_NEAR(dropped, 0.2 * pixels, count_tolerance(0.2, pixels));
  EXPECT_NEAR(flying, 0.4 * pixels, count_tolerance(0.4, pixels));  // half of those that did not drop
  // Uniform in the step: mean 0.75, standard deviation 0.3 / sqrt(12).
  EXPECT_NEAR(sum / flying, 0.75, 5.0 * 0.3 / std::sqrt(12.0 * flying));
}

}  // namespace
}  // namespace dofusion
