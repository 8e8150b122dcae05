#include "apps/settling_motion.h"

#include <gtest/gtest.h>

#include "stability/shapes.h"

namespace dofusion {
namespace {

Pose at(double x, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, 0.0, z}); }

Scene one_cube() { return {{make_block("cube")}, {at(0.0, 0.025)}}; }

// The cube beside the one on the table, 2 cm over the table, and leaning over the other's edge.
std::vector<Placement> judged(int threads) {
  PlacementOptions options;
  options.polish = false;
  options.trials = 0;
  options.threads = threads;
  return check_placements(one_cube(), make_block("cube"), {at(0.1, 0.025), at(0.1, 0.045), at(0.04, 0.075)}, options);
}

TEST(SettlingMotion, EndsWhereThePlacementWasJudged) {
  const std::vector<Placement> placements = judged(1);
  const auto motions = settling_motions(one_cube(), make_block("cube"), placements, {}, 1);
  ASSERT_EQ(motions.size(), placements.size());
  for (std::size_t k = 0; k < motions.size(); ++k) {
    SCOPED_TRACE(k);
    ASSERT_EQ(motions[k].seconds.size(), motions[k].T_world_object.size());
    EXPECT_EQ(motions[k].seconds.front(), 0.0);
    EXPECT_TRUE(std::is_sorted(motions[k].seconds.begin(), motions[k].seconds.end()));
    ASSERT_EQ(motions[k].T_world_object.front().size(), 2u);
    EXPECT_TRUE(motions[k].T_world_object.front().back().isApprox(placements[k].T_world_query, 1e-12));
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(motions[k].T_world_object.back()[i].matrix(), placements[k].settled[i].matrix());
    }
  }
}

TEST(SettlingMotion, WhatHangsInTheAirFalls) {
  std::vector<Placement> placements(1);
  placements[0].T_world_query = at(0.1, 0.045);
  const SettlingMotion motion = settling_motions(one_cube(), make_block("cube"), placements, {}, 1).front();
  ASSERT_GT(motion.seconds.size(), 3u);
  EXPECT_DOUBLE_EQ(motion.seconds[1], 0.04);
  // Free fall, g t² / 2; ten steps of semi-implicit Euler are g t dt / 2 = 0.8 mm ahead of it.
  EXPECT_NEAR(motion.T_world_object[1][1].translation().z(), 0.045 - 0.5 * 9.81 * 0.04 * 0.04, 1e-3);
  EXPECT_NEAR(motion.T_world_object.back()[1].translation().z(), 0.025, 1e-4);
  EXPECT_NEAR(motion.T_world_object.back()[0].translation().z(), 0.025, 1e-4);  // the other one stays
}

TEST(SettlingMotion, IsTheSameOnTwoThreadsAndBeyondTheMostThereIsTheStartAlone) {
  const std::vector<Placement> placements = judged(1);
  const auto one = settling_motions(one_cube(), make_block("cube"), placements, {}, 1);
  const auto two = settling_motions(one_cube(), make_block("cube"), placements, {}, 2);
  MotionOptions options;
  options.most = 1;
  const auto first = settling_motions(one_cube(), make_block("cube"), placements, {}, 2, options);
  for (std::size_t k = 0; k < placements.size(); ++k) {
    ASSERT_EQ(one[k].seconds, two[k].seconds);
    for (std::size_t f = 0; f < one[k].seconds.size(); ++f) {
      EXPECT_EQ(one[k].T_world_object[f][1].matrix(), two[k].T_world_object[f][1].matrix());
    }
    EXPECT_EQ(first[k].seconds.size(), k == 0 ? one[k].seconds.size() : 1u);
  }
  EXPECT_TRUE(settling_motions(one_cube(), make_block("cube"), {}, {}, 2).empty());
}

}  // namespace
}  // namespace dofusion
