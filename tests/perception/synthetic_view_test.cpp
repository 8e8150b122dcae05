#include "perception/synthetic_view.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "stability/shapes.h"

namespace dofusion {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

TEST(SyntheticView, ViewpointsKeepDistanceAndElevation) {
  const Eigen::Vector3d target(0.1, -0.2, 0.03);
  Rng rng = make_rng(1);
  const ViewpointOptions options;
  double lowest = 90.0, highest = 0.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i < 2000; ++i) {
    const Pose T = sample_viewpoint(target, options, rng);
    const Eigen::Vector3d offset = T.translation() - target;
    EXPECT_NEAR(offset.norm(), 0.7, 1e-12);
    EXPECT_LT((T.inverse() * target - Eigen::Vector3d(0, 0, 0.7)).norm(), 1e-12) << "the target is on the axis";
    const double elevation = std::asin(offset.z() / offset.norm()) / kDegree;
    lowest = std::min(lowest, elevation);
    highest = std::max(highest, elevation);
    sum += offset;
  }
  EXPECT_GE(lowest, 30.0 - 1e-9);
  EXPECT_LT(lowest, 31.0);
  EXPECT_LE(highest, 60.0 + 1e-9);
  EXPECT_GT(highest, 59.0);
  // All around: x and y average to zero, each of standard deviation below 0.7 / sqrt(2); five times that over 2000.
  EXPECT_LT(sum.head<2>().cwiseAbs().maxCoeff() / 2000, 5.0 * 0.5 / std::sqrt(2000.0));
}

TEST(SyntheticView, ImpossibleViewpointsThrow) {
  Rng rng = make_rng(1);
  EXPECT_THROW(sample_viewpoint({0, 0, 0}, {0.0, 30, 60}, rng), std::invalid_argument);
  EXPECT_THROW(sample_viewpoint({0, 0, 0}, {0.7, 60, 30}, rng), std::invalid_argument);
  EXPECT_THROW(sample_viewpoint({0, 0, 0}, {0.7, 30, 90}, rng), std::invalid_argument);
}

TEST(SyntheticView, SceneCentreIsThatOfTheBoxAroundAll) {
  const Scene scene{{make_block("cube"), make_block("cube")},
                    {make_pose(Eigen::Matrix3d::Identity(), {0.1, 0, 0.025}),
                     make_pose(Eigen::Matrix3d::Identity(), {-0.1, 0.05, 0.075})}};
  EXPECT_LT((scene_centre(scene) - Eigen::Vector3d(0, 0.025, 0.05)).norm(), 1e-12);
  EXPECT_EQ(scene_centre({}), Eigen::Vector3d::Zero());
}

// A sphere's outline is a cone around it; it fills three quarters of the image's height. From all around it is whole.
TEST(SyntheticView, FromTheViewingDistanceObjectsFillTheImage) {
  const Camera camera = default_camera();
  const Scene ball{{make_sphere("ball", 0.2)}, {make_pose(Eigen::Matrix3d::Identity(), {1, 2, 0.3})}};
  const double outline = std::asin(0.2 / viewing_distance(ball, camera));
  EXPECT_NEAR(2.0 * camera.fy * std::tan(outline), 0.75 * camera.height, 0.5);  // its mesh's corners lie on the sphere
  EXPECT_THROW(viewing_distance({}, camera), std::invalid_argument);
}

TEST(SyntheticView, EnclosesWhatLiesInsideTheSurface) {
  const TriangleMesh box = box_mesh({2, 4, 6});
  EXPECT_TRUE(encloses(box, {0.9, -1.9, 2.9}));
  EXPECT_FALSE(encloses(box, {1.1, 0, 0}));
  EXPECT_FALSE(encloses({}, {0, 0, 0}));
}

TEST(SyntheticView, SeesEveryObjectAndRepeatsWithItsSeed) {
  const Scene scene{{make_block("cube"), make_block("hat")},
                    {make_pose(Eigen::Matrix3d::Identity(), {0.0, 0, 0.025}),
                     make_pose(Eigen::Matrix3d::Identity(), {0.15, 0.0, 0.02})}};
  const Camera camera = default_camera();
  Rng a = make_rng(5), b = make_rng(5);
  const SyntheticView view = make_synthetic_view(scene, camera, {}, a);
  const SyntheticView again = make_synthetic_view(scene, camera, {}, b);
  EXPECT_EQ(view.depth.pixels, again.depth.pixels);
  EXPECT_EQ(view.truth.labels.pixels, again.truth.labels.pixels);
  for (int i = 0; i < 2; ++i) {
    // A 5 cm block at 0.7 m is 43 px wide.
    const auto pixels = std::count(view.truth.labels.pixels.begin(), view.truth.labels.pixels.end(),
                                   static_cast<std::uint8_t>(kLabelFirstObject + i));
    EXPECT_GT(pixels, 500) << i;
  }
}

}  // namespace
}  // namespace dofusion
