#include "stability/resting_poses.h"

#include <gtest/gtest.h>

#include "stability/shapes.h"

namespace dofusion {
namespace {

TEST(RestingPoses, OfABoxAreItsSixFaces) {
  const auto poses = resting_poses(box_mesh({0.02, 0.04, 0.06}));
  ASSERT_EQ(poses.size(), 6u);
  for (const RestingPose& pose : poses) {
    double lowest = 1.0;
    for (const auto& v : box_mesh({0.02, 0.04, 0.06}).vertices) lowest = std::min(lowest, (pose.R_world_object * v).z());
    EXPECT_NEAR(lowest, -pose.height, 1e-12);
  }
}

TEST(RestingPoses, OfAnObliquePrismLeaveOutTheFaceItTipsOver) {
  // A parallelogram that leans far over: it stands on neither of its short sides.
  const TriangleMesh prism = prism_mesh({{0, 0}, {1, 0}, {4, 2}, {3, 2}}, 0, 3);
  const auto poses = resting_poses(translated(prism, -centre_of_mass(prism)));
  EXPECT_EQ(poses.size(), 4u);  // two ends and the two long sides
}

}  // namespace
}  // namespace dofusion
