#include "perception/plausibility.h"

#include <gtest/gtest.h>

#include "stability/shape_families.h"

namespace dofusion {
namespace {

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

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

// The upper box's centre lies 1 mm beyond the edge of the one below: let go, it falls 5 cm and turns over. Moved by
// little more than that it stands.
TEST(Plausibility, WhatIsSeenALittleTooFarOutIsShiftedOntoItsSupport) {
  const ObjectPtr box = make_box("box", {0.05, 0.05, 0.05});
  const Scene recovered{{box, box}, {at(0, 0, 0.025), at(0.026, 0, 0.075)}};
  const SettleResult let_go = Simulator(recovered.objects).settle(recovered.T_world_object);
  ASSERT_FALSE(is_stable(displacement(recovered.objects, recovered.T_world_object, let_go.T_world_object)));
  const PlausibleScene result = make_plausible(recovered);
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  EXPECT_GT(result.attempts, 1);
  EXPECT_LT(result.moved_pct, 8.0);  // the second step aside, 7 % of 87 mm, at most
  EXPECT_LT(result.moved_deg, 1.0);
  EXPECT_NEAR(result.scene.T_world_object[1].translation().z(), 0.075, 5e-4);
}

// An arch over a box whose top reaches 2 mm into the lintel: its parts are pushed apart as convex solids are.
TEST(Plausibility, PartsOfNonConvexObjectsArePushedApart) {
  Rng rng = make_rng(3);
  const ObjectPtr arch = draw_shape(ShapeFamilyKind::kArch, rng);
  ASSERT_EQ(arch->parts.size(), 3U);
  const BoundingBox whole = bounding_box(arch->mesh);
  const double lift = -whole.min.z();
  const ObjectPtr box = make_box("box", {0.02, 0.02, 0.02});
  const double top = whole.max.z() + lift;
  const Scene recovered{{arch, box}, {at(0, 0, lift), at(0, 0, top + 0.01 - 0.002)}};
  const PlausibleScene result = make_plausible(recovered);
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  EXPECT_EQ(result.attempts, 1);
  EXPECT_NEAR(result.scene.T_world_object[1].translation().z(), top + 0.01, 5e-4);
  EXPECT_LT(result.moved_deg, 1.0);
}

TEST(Plausibility, NoShiftIsTriedWhereNothingTopples) {
  const ObjectPtr box = make_box("box", {0.05, 0.05, 0.05});
  EXPECT_EQ(make_plausible({{box}, {at(0, 0, 0.1)}}).attempts, 1);
  EXPECT_EQ(make_plausible({{box}, {at(0, 0, 0.025)}}).attempts, 1);
}

TEST(Plausibility, MotionIsOneAtTheLimitsOfStability) {
  EXPECT_DOUBLE_EQ(motion({10.0, 3.0}), 1.0);
  EXPECT_DOUBLE_EQ(motion({3.0, 20.0}), 2.0);
}

TEST(Plausibility, AnEmptySceneIsPlausible) {
  const PlausibleScene result = make_plausible({});
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  EXPECT_EQ(result.moved_pct, 0.0);
}

}  // namespace
}  // namespace dofusion
