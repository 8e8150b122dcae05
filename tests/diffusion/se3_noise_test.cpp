#include "diffusion/se3_noise.h"

#include <gtest/gtest.h>

namespace dofusion {
namespace {

Pose random_pose(Rng& rng) { return make_pose(random_rotation(rng), normal3(rng)); }

TEST(Se3Noise, BodyNoiseIsTheEquation) {
  Rng rng = make_rng(1);
  const Pose pose = random_pose(rng);
  const Vector6 e = noise6(rng, 0.7);
  const Pose noisy = add_body_noise(pose, e, 0.05);
  EXPECT_TRUE(noisy.translation().isApprox(pose.translation() + 0.05 * e.head<3>()));
  EXPECT_TRUE(noisy.linear().isApprox(pose.linear() * so3_exp(e.tail<3>())));
}

TEST(Se3Noise, RemovingBodyNoiseUndoesIt) {
  Rng rng = make_rng(2);
  for (const double sigma : {0.0, 1e-8, 0.1, 1.0, 10.0}) {
    const Pose pose = random_pose(rng);
    const Vector6 e = noise6(rng, sigma);
    EXPECT_TRUE(remove_body_noise(add_body_noise(pose, e, 0.05), e, 0.05).isApprox(pose, 1e-12));
  }
}

TEST(Se3Noise, ResidualLeadsBackToTheCleanPose) {
  Rng rng = make_rng(3);
  for (const double sigma : {1e-8, 0.005, 0.1, 1.0, 3.0}) {
    const Pose pose = random_pose(rng);
    const Pose noisy = add_world_noise(pose, noise6(rng, sigma), 0.05);
    const Vector6 residual = world_residual(noisy, pose, sigma, 0.05);
    EXPECT_TRUE(apply_world_residual(noisy, residual, sigma, 0.05).isApprox(pose, 1e-9)) << sigma;
  }
}

TEST(Se3Noise, SmallResidualIsMinusTheNoise) {
  Rng rng = make_rng(4);
  const double sigma = 1e-3;
  const Pose pose = random_pose(rng);
  const Vector6 e = noise6(rng, sigma);
  const Vector6 residual = world_residual(add_world_noise(pose, e), pose, sigma);
  // rotation_scale differs from sigma by (sigma / 1.5)^2 / 2 in relative terms.
  EXPECT_TRUE(residual.isApprox(-e / sigma, 1e-6));
}

// What makes the target readable off a cloud: turning the whole scene turns the residual, whatever the object's frame.
TEST(Se3Noise, ResidualTurnsWithTheWorldAndIgnoresTheBodyFrame) {
  Rng rng = make_rng(5);
  const double sigma = 0.8;
  const Pose pose = random_pose(rng), noisy = add_world_noise(pose, noise6(rng, sigma));
  const Vector6 residual = world_residual(noisy, pose, sigma);
  const Pose turn = make_pose(random_rotation(rng), Eigen::Vector3d::Zero());
  const Vector6 turned = world_residual(turn * noisy, turn * pose, sigma);
  EXPECT_TRUE(turned.head<3>().isApprox(turn.linear() * residual.head<3>(), 1e-9));
  EXPECT_TRUE(turned.tail<3>().isApprox(turn.linear() * residual.tail<3>(), 1e-9));
  const Pose body = make_pose(random_rotation(rng), Eigen::Vector3d::Zero());
  EXPECT_TRUE(world_residual(noisy * body, pose * body, sigma).isApprox(residual, 1e-9));
}

TEST(Se3Noise, RotationScaleSaturates) {
  EXPECT_NEAR(rotation_scale(0.01), 0.01, 1e-6);
  EXPECT_NEAR(rotation_scale(1e6), 1.5, 1e-6);
}

TEST(Se3Noise, NoiseHasItsScale) {
  Rng rng = make_rng(6);
  Vector6 squares = Vector6::Zero();
  const int count = 20000;
  for (int i = 0; i < count; ++i) squares += noise6(rng, 0.3).cwiseAbs2();
  // The standard error of a variance estimate is sqrt(2 / count) = 1 %.
  for (int d = 0; d < 6; ++d) EXPECT_NEAR(squares[d] / count, 0.09, 0.09 * 0.05);
}

}  // namespace
}  // namespace dofusion
