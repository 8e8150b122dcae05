#include "perception/plausibility.h"

#include <gtest/gtest.h>

namespace dofusion {
namespace {

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

TEST(Plausibility, ASceneThatStandsTakesOneAttemptAndOneThatFallsSeveral) {
  const ObjectPtr box = make_box("box", {0.05, 0.05, 0.05});
  EXPECT_EQ(make_plausible({{box}, {at(0, 0, 0.025)}}).attempts, 1);
  // Its centre of mass lies beyond the edge of what it is on: it falls from every start, by about its own height.
  const PlausibleScene falls = make_plausible({{box, box}, {at(0, 0, 0.025), at(0.03, 0, 0.075)}});
  EXPECT_EQ(falls.attempts, 4);
  EXPECT_EQ(falls.status, SettleStatus::kSettled);
  EXPECT_GT(falls.moved_pct, 10.0);
}

TEST(Plausibility, AStandingSceneStays) {
  const ObjectPtr box = make_box("box", {0.05, 0.05, 0.05});
  const PlausibleScene result = make_plausible({{box, box}, {at(0, 0, 0.0251), at(0, 0, 0.0753)}});
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  EXPECT_LT(result.moved_pct, 1.0);  // gaps of 0.1 mm on a diameter of 87 mm, and the contacts' softness
  EXPECT_LT(result.moved_deg, 0.5);
}

TEST(Plausibility, OverlapsArePushedApartGently) {
  const ObjectPtr box = make_box("box", {0.05, 0.05, 0.05});
  // 4 mm into each other, 2 mm into the table: no explosion.
  const PlausibleScene result = make_plausible({{box, box}, {at(0, 0, 0.023), at(0.046, 0, 0.025)}});
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  EXPECT_LT(result.moved_pct, 5.0);
  EXPECT_LT(result.moved_deg, 2.0);
  EXPECT_GT((result.scene.T_world_object[1].translation() - result.scene.T_world_object[0].translation()).norm(),
            0.0495);
}

TEST(Plausibility, WhatFallsIsReported) {
  const ObjectPtr box = make_box("box", {0.05, 0.05, 0.05});
  const PlausibleScene result = make_plausible({{box}, {at(0, 0, 0.1)}});
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  EXPECT_NEAR(result.moved_pct, 100.0 * 0.075 / (0.05 * std::sqrt(3.0)), 2.0);
}

TEST(Plausibility, AnEmptySceneIsPlausible) {
  const PlausibleScene result = make_plausible({});
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  EXPECT_EQ(result.moved_pct, 0.0);
}

}  // namespace
}  // namespace dofusion
