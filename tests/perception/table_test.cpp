#include "perception/table.h"

#include <limits>

#include <gtest/gtest.h>

#include "box_image.h"

namespace dofusion {
namespace {

const Pose kView = look_at({0.1, -0.6, 0.5}, {0.0, 0.0, 0.0});

TEST(Table, IsFoundWhereItIs) {
  const DepthSigma sigma{0.0, 1.7e-3};
  const BoxImage image =
      render_boxes({upright_box({0.1, 0.06, 0.08}, {0, 0, 0.04}, 0.4)}, test_camera(), kView, sigma, 1);
  const std::optional<Table> table = find_table(image.depth, test_camera());
  ASSERT_TRUE(table);
  // 60,000 readings with about 1 mm of noise: the plane is known to far better than 0.3 mm and 0.1 degrees.
  EXPECT_NEAR(table->T_world_camera.translation().z(), 0.5, 3e-4);
  const Eigen::Vector3d up = table->T_world_camera.linear().transpose().col(2);
  EXPECT_GT(up.dot(kView.linear().transpose().col(2)), std::cos(0.1 * M_PI / 180.0));
  EXPECT_GT(table->inliers, 50000);
  EXPECT_NEAR(table->residual, 0.0007, 0.0004);
}

TEST(Table, FrameFollowsTheOpticalAxisAndTheCamerasX) {
  const BoxImage image = render_boxes({}, test_camera(), kView, {0.0, 0.0}, 1);
  const std::optional<Table> table = find_table(image.depth, test_camera());
  ASSERT_TRUE(table);
  const Eigen::Vector3d axis = table->T_world_camera.linear().col(2);
  const Eigen::Vector3d foot =
      table->T_world_camera.translation() - axis * table->T_world_camera.translation().z() / axis.z();
  EXPECT_LT(foot.norm(), 1e-4);                                  // the optical axis meets the origin
  EXPECT_NEAR(table->T_world_camera.linear()(1, 0), 0.0, 1e-6);  // camera x in the world's x-z plane
  EXPECT_NEAR(table->T_world_camera.linear().determinant(), 1.0, 1e-9);
}

TEST(Table, PlaneAndPoseAgree) {
  const InversePlane plane(0.3, 0.9, 1.1);
  EXPECT_LT((table_plane(table_from_plane(plane)) - plane).norm(), 1e-12);
  const InversePlane behind(0.0, 2.0, -0.1);  // the optical axis leaves the table
  const Table table = table_from_plane(behind);
  EXPECT_LT(table.T_world_camera.translation().head<2>().norm(), 1e-12);
  EXPECT_NEAR(table.T_world_camera.translation().z(), 1.0 / behind.norm(), 1e-12);
}

TEST(Table, NoiseIsCalibrated) {
  const DepthSigma truth{0.0, 3e-3};
  const BoxImage image = render_boxes({}, test_camera(), kView, truth, 2);
  const std::optional<Table> table = find_table(image.depth, test_camera());
  ASSERT_TRUE(table);
  const DepthSigma found = calibrate_sigma(image.depth, test_camera(), *table);
  EXPECT_NEAR(found(0.7), truth(0.7), 0.05 * truth(0.7));
  EXPECT_LT(measure_warp(image.depth, test_camera(), *table, found), 0.1);  // independent noise bends nothing
}

TEST(Table, NoneInImagesWithoutAPlane) {
  const Camera camera = test_camera();
  EXPECT_FALSE(find_table(DepthImage(camera.width, camera.height), camera));
  EXPECT_FALSE(find_table(DepthImage(camera.width, camera.height, std::numeric_limits<float>::quiet_NaN()), camera));
  EXPECT_FALSE(find_table(DepthImage(camera.width, camera.height, -1.0F), camera));
  DepthImage noise(camera.width, camera.height);
  Rng rng = make_rng(3);
  for (float& z : noise.pixels) z = static_cast<float>(uniform(rng, 0.3, 3.0));
  EXPECT_FALSE(find_table(noise, camera));
  const Camera tiny{1.0, 1.0, 0.0, 0.0, 1, 1, 1.0};
  EXPECT_FALSE(find_table(DepthImage(1, 1, 1.0F), tiny));
}

TEST(Table, WrongSizesAreTheCallersMistake) {
  EXPECT_THROW(find_table(DepthImage(3, 3), test_camera()), std::invalid_argument);
  EXPECT_THROW(find_table(DepthImage(1, 1), Camera{0.0, 0.0, 0.0, 0.0, 1, 1, 1.0}), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
