#include "stability/pose.h"

#include <gtest/gtest.h>

#include "stability/random.h"

namespace dofusion {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

TEST(So3, ExpOfLogIsTheRotation) {
  Rng rng = make_rng(1);
  for (int i = 0; i < 200; ++i) {
    const Matrix3d R = random_rotation(rng);
    EXPECT_TRUE(so3_exp(so3_log(R)).isApprox(R, 1e-12));
  }
}

TEST(So3, LogOfExpIsTheVectorFromTinyToNearPi) {
  Rng rng = make_rng(2);
  for (const double angle : {0.0, 1e-13, 1e-8, 1e-3, 1.0, 3.0, M_PI - 1e-6}) {
    const Vector3d w = normal3(rng).normalized() * angle;
    EXPECT_LT((so3_log(so3_exp(w)) - w).norm(), 1e-9) << "angle " << angle;
  }
}

TEST(So3, LogAtPiHasLengthPi) {
  const Matrix3d half_turn = Vector3d(1, -1, -1).asDiagonal();
  EXPECT_NEAR(so3_log(half_turn).norm(), M_PI, 1e-12);
  EXPECT_NEAR(std::abs(so3_log(half_turn).x()), M_PI, 1e-12);
}

TEST(So3, AngleIsExactForSmallRotations) {
  // acos of the trace would lose half the digits here.
  EXPECT_NEAR(rotation_angle(so3_exp(Vector3d(1e-7, 0, 0))), 1e-7, 1e-15);
  EXPECT_NEAR(rotation_angle(so3_exp(Vector3d(0, 3.0, 0))), 3.0, 1e-12);
}

TEST(PoseArray, IsPositionThenScalarFirstQuaternion) {
  const Pose quarter_turn = make_pose(so3_exp(Vector3d(0, 0, M_PI / 2)), Vector3d(1, 2, 3));
  const PoseArray a = to_array(quarter_turn);
  const PoseArray expected = {1, 2, 3, std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(a[i], expected[i], 1e-12);
  EXPECT_TRUE(from_array(a).isApprox(quarter_turn, 1e-12));
}

TEST(RandomRotation, IsUniform) {
  // The mean of uniform rotations is zero; each entry has variance 1/3, so the mean of n has deviation sqrt(1/3n).
  Rng rng = make_rng(3);
  const int n = 20000;
  Matrix3d mean = Matrix3d::Zero();
  for (int i = 0; i < n; ++i) mean += random_rotation(rng) / n;
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), 5.0 * std::sqrt(1.0 / 3.0 / n));
}

TEST(Rng, StreamsOfOneSeedDifferAndRepeat) {
  EXPECT_EQ(make_rng(5, 7)(), make_rng(5, 7)());
  EXPECT_NE(make_rng(5, 7)(), make_rng(5, 8)());
  EXPECT_NE(make_rng(5, 7)(), make_rng(6, 7)());
}

}  // namespace
}  // namespace dofusion
