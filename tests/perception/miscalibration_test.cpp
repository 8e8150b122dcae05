#include "perception/miscalibration.h"

#include <cmath>

#include <gtest/gtest.h>

namespace dofusion {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

CalibratedCamera true_camera() {
  return {{600.0, 610.0, 319.5, 239.5, 640, 480, 0.1}, look_at({0.5, 0.3, 0.6}, Eigen::Vector3d::Zero())};
}

TEST(Miscalibration, ErrorsHaveTheirStandardDeviations) {
  const CalibratedCamera truth = true_camera();
  const Miscalibration errors{0.3, 0.002, 0.5, 1.5};
  constexpr int kDraws = 4000;
  constexpr double kScale = 2.0;
  Eigen::Vector3d turns = Eigen::Vector3d::Zero(), shifts = turns;
  double focal = 0.0, centre = 0.0, mean = 0.0;
  Rng rng = make_rng(5);
  for (int k = 0; k < kDraws; ++k) {
    const CalibratedCamera taken = miscalibrated(truth, errors, kScale, rng);
    const Eigen::Matrix3d turn = truth.T_world_camera.linear().transpose() * taken.T_world_camera.linear();
    turns += so3_log(turn).cwiseAbs2() / kDraws;
    shifts += (taken.T_world_camera.translation() - truth.T_world_camera.translation()).cwiseAbs2() / kDraws;
    focal += std::pow(taken.camera.fx / truth.camera.fx - 1.0, 2) / kDraws;
    mean += (taken.camera.fx / truth.camera.fx - 1.0) / kDraws;
    centre += std::pow(taken.camera.cx - truth.camera.cx, 2) / kDraws;
    EXPECT_NEAR(taken.camera.fx / truth.camera.fx, taken.camera.fy / truth.camera.fy, 1e-12);
    EXPECT_EQ(taken.camera.width, truth.camera.width);
  }
  // A standard deviation from n draws is known to 1 / sqrt(2 n) of itself: five times that.
  const double tolerance = 5.0 / std::sqrt(2.0 * kDraws);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(std::sqrt(turns[axis]) / (kScale * 0.3 * kDegree), 1.0, tolerance);
    EXPECT_NEAR(std::sqrt(shifts[axis]) / (kScale * 0.002), 1.0, tolerance);
  }
  EXPECT_NEAR(std::sqrt(focal) / (kScale * 0.005), 1.0, tolerance);
  EXPECT_NEAR(std::sqrt(centre) / (kScale * 1.5), 1.0, tolerance);
  EXPECT_NEAR(mean, 0.0, 5.0 * kScale * 0.005 / std::sqrt(kDraws));
}

TEST(Miscalibration, ScaleZeroIsTheTruthAndSeedsRepeat) {
  const CalibratedCamera truth = true_camera();
  Rng rng = make_rng(5), a = make_rng(6), b = make_rng(6);
  const Miscalibration errors{1.0, 0.01, 1.0, 2.0};
  EXPECT_EQ(miscalibrated(truth, errors, 0.0, rng).T_world_camera.matrix(), truth.T_world_camera.matrix());
  EXPECT_EQ(miscalibrated(truth, errors, 0.0, rng).camera.fx, truth.camera.fx);
  EXPECT_EQ(miscalibrated(truth, errors, 1.0, a).T_world_camera.matrix(),
            miscalibrated(truth, errors, 1.0, b).T_world_camera.matrix());
}

TEST(Miscalibration, StaysACamera) {
  Rng rng = make_rng(7);
  for (int k = 0; k < 100; ++k) EXPECT_GE(miscalibrated(true_camera(), {0, 0, 200.0, 0}, 1.0, rng).camera.fx, 60.0);
  EXPECT_THROW(miscalibrated(true_camera(), {}, -1.0, rng), std::invalid_argument);
  EXPECT_THROW(miscalibrated(true_camera(), {-1.0, 0, 0, 0}, 1.0, rng), std::invalid_argument);
  EXPECT_THROW(miscalibrated(true_camera(), {0, std::nan(""), 0, 0}, 1.0, rng), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
