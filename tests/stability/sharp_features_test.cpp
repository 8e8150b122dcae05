#include "stability/sharp_features.h"

#include <gtest/gtest.h>

#include "stability/shapes.h"

namespace dofusion {
namespace {

double total_length(const SharpFeatures& features) {
  double sum = 0.0;
  for (const SharpFeatures::Edge& edge : features.edges) sum += (edge.to - edge.from).norm();
  return sum;
}

TEST(SharpFeatures, ABoxHasItsTwelveEdgesAndEightCornersHoweverItIsTriangulated) {
  const TriangleMesh box = box_mesh({1.0, 2.0, 3.0});
  const SharpFeatures features = sharp_features(box);
  EXPECT_EQ(features.edges.size(), 12u);
  EXPECT_EQ(features.corners.size(), 8u);
  EXPECT_NEAR(total_length(features), 24.0, 1e-12);

  TriangleMesh apart;  // as STL has it
  for (const Eigen::Vector3i& t : box.triangles) {
    const int first = static_cast<int>(apart.vertices.size());
    for (int k = 0; k < 3; ++k) apart.vertices.push_back(box.vertices[t[k]]);
    apart.triangles.emplace_back(first, first + 1, first + 2);
  }
  EXPECT_EQ(sharp_features(apart).edges.size(), 12u);
  EXPECT_EQ(sharp_features(apart).corners.size(), 8u);
}

TEST(SharpFeatures, ACylinderHasTwoRimsWithoutCornersAndABallNothing) {
  const SharpFeatures cylinder = sharp_features(cylinder_mesh(0.5, 2.0));
  EXPECT_EQ(cylinder.edges.size(), 128u);
  EXPECT_TRUE(cylinder.corners.empty());
  EXPECT_NEAR(total_length(cylinder), 2.0 * M_PI, 0.01);
  EXPECT_TRUE(sharp_features(sphere_mesh(1.0)).edges.empty());
}

TEST(SharpFeatures, AHoleInTheSurfaceHasAnEdge) {
  TriangleMesh open = sphere_mesh(1.0);
  open.triangles.pop_back();
  EXPECT_EQ(sharp_features(open).edges.size(), 3u);
}

}  // namespace
}  // namespace dofusion
