#include "stability/outcome.h"

#include <gtest/gtest.h>

#include "stability/robustness.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

Outcome outcome_of(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& start, int query) {
  return judge(objects, start, Simulator(objects).settle(start), query);
}

TEST(Outcome, AStackThatStands) {
  const ObjectPtr cube = make_block("cube");
  const Outcome outcome = outcome_of({cube, cube}, {at(0, 0, 0.025), at(0.005, 0, 0.075)}, 1);
  EXPECT_EQ(outcome.status, SettleStatus::kSettled);
  EXPECT_TRUE(outcome.stable && outcome.quiet && outcome.stacked);
  EXPECT_FALSE(outcome.tilted);
  EXPECT_LT(outcome.accumulated_rotation_deg, 0.1);
}

TEST(Outcome, ABlockBesideIsStableButNotStacked) {
  const ObjectPtr cube = make_block("cube");
  const Outcome outcome = outcome_of({cube, cube}, {at(0, 0, 0.025), at(0.1, 0, 0.025)}, 1);
  EXPECT_TRUE(outcome.stable);
  EXPECT_FALSE(outcome.stacked);
}

TEST(Outcome, ABlockThatFallsOffTiltsAndTurnsButTheContextStays) {
  const ObjectPtr cube = make_block("cube"), tall = make_block("rectangle");
  const Outcome outcome = outcome_of({cube, tall}, {at(0, 0, 0.025), at(0.03, 0, 0.1)}, 1);
  EXPECT_EQ(outcome.status, SettleStatus::kSettled);
  EXPECT_FALSE(outcome.stable || outcome.quiet || outcome.stacked);
  EXPECT_TRUE(outcome.tilted);
  EXPECT_GT(outcome.accumulated_rotation_deg, outcome.displacement.rotation_deg - 1e-6);  // a sum of parts
}

TEST(Outcome, TurningAboutTheVerticalIsNoTilt) {
  const std::vector<Pose> before = {at(0, 0, 0)}, turned = {make_pose(so3_exp({0, 0, 1.0}), {0, 0, 0})},
                          tipped = {make_pose(so3_exp({0.5, 0, 0}) * so3_exp({0, 0, 1.0}), {0, 0, 0})};
  EXPECT_NEAR(largest_tilt_deg(before, turned), 0.0, 1e-9);
  EXPECT_NEAR(largest_tilt_deg(before, tipped), 0.5 * 180.0 / M_PI, 1e-9);
}

TEST(Outcome, ADivergedSimulationIsInfinitelyFarOff) {
  const ObjectPtr cube = make_block("cube");
  SettleResult diverged;
  diverged.T_world_object = {at(0, 0, 0.025)};
  const Outcome outcome = judge({cube}, {at(0, 0, 0.025)}, diverged, 0);
  EXPECT_FALSE(outcome.stable || outcome.quiet || outcome.stacked);
  EXPECT_TRUE(outcome.tilted);
  EXPECT_TRUE(std::isinf(outcome.displacement.translation_pct));
  EXPECT_THROW(judge({cube}, {at(0, 0, 0.025)}, diverged, 1), std::invalid_argument);
}

TEST(LargestPush, IsTheSmallerOfFrictionAndTipping) {
  // A cube slides at the friction, 0.8 of its weight; it would tip at 1. The upright rectangle, half as wide as high,
  // tips at 0.5. Lying down it slides. Friction of soft contacts gives way up to 5 % earlier.
  const ObjectPtr cube = make_block("cube"), tall = make_block("rectangle");
  EXPECT_NEAR(largest_push(Simulator({cube}), {at(0, 0, 0.025)}, 0), 0.8, 0.04);
  EXPECT_NEAR(largest_push(Simulator({tall}), {at(0, 0, 0.05)}, 0), 0.5, 0.02);
  const Pose lying = make_pose(so3_exp({M_PI / 2, 0, 0}), {0, 0, 0.025});
  EXPECT_NEAR(largest_push(Simulator({tall}), {lying}, 0), 0.8, 0.04);
  // Half over the edge by 20 mm of 25: the table below holds 5 mm, and tips it at 5 / 25 outwards.
  const ObjectPtr base = make_box("base", {0.2, 0.2, 0.1});
  const Simulator on_edge({base, cube}, {}, {true, false});
  EXPECT_NEAR(largest_push(on_edge, {at(0, 0, 0.05), at(0.095, 0, 0.125)}, 1), 0.2, 0.02);
  EXPECT_EQ(largest_push(on_edge, {at(0, 0, 0.05), at(0.11, 0, 0.125)}, 1), 0.0);  // falls by itself
  EXPECT_THROW(largest_push(Simulator({cube}), {at(0, 0, 0.025)}, 1), std::invalid_argument);
}

TEST(UpsideDown, WhatLiesFreeComesOffAndWhatIsCaughtDoesNot) {
  const ObjectPtr cube = make_block("cube");
  EXPECT_TRUE(comes_off_upside_down(Simulator({cube}), {at(0, 0, 0.025)}, 0));
  EXPECT_TRUE(comes_off_upside_down(Simulator({cube, cube}), {at(0, 0, 0.025), at(0, 0, 0.075)}, 1));
  // The lower one takes the upper one along.
  EXPECT_TRUE(comes_off_upside_down(Simulator({cube, cube}), {at(0, 0, 0.025), at(0, 0, 0.075)}, 0));

  // A clamp: floor, ceiling and back of one solid, around a cube whose middle is as high as its own.
  const auto box_at = [](const Vector3d& size, const Vector3d& middle) { return translated(box_mesh(size), middle); };
  const std::vector<TriangleMesh> parts = {box_at({0.1, 0.05, 0.02}, {0, 0, -0.036}), box_at({0.1, 0.05, 0.02}, {0, 0, 0.036}),
                                           box_at({0.02, 0.05, 0.052}, {-0.04, 0, 0})};
  auto clamp = std::make_shared<Object>(*make_box("clamp", {0.1, 0.05, 0.092}));
  clamp->kind = SolidKind::kMesh;
  clamp->box_edges.reset();
  clamp->convex = false;
  clamp->parts = parts;
  EXPECT_FALSE(comes_off_upside_down(Simulator({clamp, cube}), {at(0, 0, 0.046), at(0.02, 0, 0.0455)}, 1));
}

}  // namespace
}  // namespace dofusion
