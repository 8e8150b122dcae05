#include "apps/placement.h"

#include <gtest/gtest.h>

namespace dofusion {
namespace {

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

// A 50 mm cube on the table at the origin.
Scene one_cube() { return {{make_block("cube")}, {at(0, 0, 0.025)}}; }

TEST(CheckPlacements, RestingRanksBeforeHanging) {
  const ObjectPtr cube = make_block("cube");
  const Pose resting = at(0.15, 0, 0.025), hanging = at(0.15, 0, 0.30);
  const std::vector<Placement> placements = check_placements(one_cube(), cube, {hanging, resting}, {});
  ASSERT_EQ(placements.size(), 2u);
  EXPECT_TRUE(placements[0].stable);
  EXPECT_TRUE(placements[0].T_world_sampled.isApprox(resting));
  EXPECT_LT(placements[0].displacement.translation_pct, 0.5);  // the metric's floor is 0.03 % (median)
  EXPECT_EQ(placements[0].robustness, 1.0);                    // a cube on its face stands 1.5 mm and 0.7 degrees
  EXPECT_EQ(placements[0].settled.size(), 2u);
  EXPECT_FALSE(placements[1].stable);
  // It falls 275 mm; a cube's diameter is 50 mm times the square root of 3.
  EXPECT_NEAR(placements[1].displacement.translation_pct, 100.0 * 0.275 / (0.05 * std::sqrt(3.0)), 60.0);
  EXPECT_FALSE(placements[1].robustness);  // not tried: it does not stand as it is
}

TEST(CheckPlacements, OverlapIsMeasured) {
  PlacementOptions options;
  options.polish = false;
  const std::vector<Placement> placements = check_placements(one_cube(), make_block("cube"), {at(0.045, 0, 0.025)}, options);
  EXPECT_NEAR(placements[0].penetration, 0.005, 0.0005);  // 5 mm of 50; contacts are soft
}

TEST(CheckPlacements, WhatStandsWhenDisturbedRanksFirst) {
  PlacementOptions options;
  options.trials = 12;
  options.polish = false;
  // The second stands on the other cube with its centre of mass 1 mm inside the edge: still for now.
  const std::vector<Placement> placements =
      check_placements(one_cube(), make_block("cube"), {at(0.024, 0, 0.075), at(0.15, 0, 0.025)}, options);
  EXPECT_TRUE(placements[0].T_world_query.isApprox(at(0.15, 0, 0.025)));
  EXPECT_EQ(placements[0].robustness, 1.0);
  EXPECT_LT(placements[1].robustness.value_or(0.0), 1.0);
}

TEST(CheckPlacements, PolishTakesWhereItCameToRestAndKeepsTheSample) {
  const Pose above = at(0.15, 0, 0.028);  // falls 3 mm, 3.5 % of its diameter
  PlacementOptions options;
  const Placement polished = check_placements(one_cube(), make_block("cube"), {above}, options)[0];
  EXPECT_TRUE(polished.stable);
  EXPECT_NEAR(polished.T_world_query.translation().z(), 0.025, 2e-4);
  EXPECT_TRUE(polished.T_world_sampled.isApprox(above));
  EXPECT_LT(polished.displacement.translation_pct, 0.5);
  options.polish = false;
  const Placement raw = check_placements(one_cube(), make_block("cube"), {above}, options)[0];
  EXPECT_TRUE(raw.T_world_query.isApprox(above));
  EXPECT_NEAR(raw.displacement.translation_pct, 100.0 * 0.003 / (0.05 * std::sqrt(3.0)), 0.5);
}

TEST(CheckPlacements, TheNumberOfThreadsChangesNothing) {
  std::vector<Pose> candidates;
  Rng rng = make_rng(2);
  for (int i = 0; i < 12; ++i) {
    candidates.push_back(at(uniform(rng, -0.1, 0.1), uniform(rng, -0.1, 0.1), uniform(rng, 0.02, 0.1)));
  }
  PlacementOptions options;
  options.seed = 4;
  const std::vector<Placement> one = check_placements(one_cube(), make_block("hat"), candidates, options);
  for (const int threads : {3, 64}) {
    options.threads = threads;
    const std::vector<Placement> many = check_placements(one_cube(), make_block("hat"), candidates, options);
    ASSERT_EQ(many.size(), one.size());
    for (std::size_t i = 0; i < one.size(); ++i) {
      EXPECT_EQ(many[i].T_world_query.matrix(), one[i].T_world_query.matrix());
      EXPECT_EQ(many[i].robustness, one[i].robustness);
      EXPECT_EQ(many[i].displacement.translation_pct, one[i].displacement.translation_pct);
    }
  }
}

TEST(CheckPlacements, EmptyTableAndNoCandidates) {
  EXPECT_TRUE(check_placements({}, make_block("cube"), {}, {}).empty());
  EXPECT_TRUE(check_placements({}, make_block("cube"), {at(0, 0, 0.025)}, {})[0].stable);
}

TEST(PlacementProblems, LookAtEveryObjectInTurnWithItsNeighbour) {
  Scene scene;
  for (const double x : {0.0, 0.06, 1.0, 1.06}) {  // two pairs far apart
    scene.objects.push_back(make_block("cube"));
    scene.T_world_object.push_back(at(x, 0, 0.025));
  }
  PlacementOptions options;
  options.samples = 8;
  const std::vector<PlacementProblem> problems = placement_problems(scene, make_block("hat"), options);
  ASSERT_EQ(problems.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) {
    ASSERT_EQ(problems[i].context.objects.size(), 2u);
    EXPECT_EQ(problems[i].context.T_world_object[0].translation().x(), scene.T_world_object[i % 4].translation().x());
    EXPECT_NEAR(problems[i].centre.x(), i % 4 < 2 ? 0.03 : 1.03, 1e-12);
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(problems[i].seed, problems[j].seed);
  }
}

TEST(PlacementProblems, ASmallSceneIsSeenWhole) {
  EXPECT_EQ(placement_problems(one_cube(), make_block("hat"), {}).front().context.objects.size(), 1u);
  EXPECT_TRUE(placement_problems({}, make_block("hat"), {}).front().context.objects.empty());
}

}  // namespace
}  // namespace dofusion
