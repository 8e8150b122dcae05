// Draws of what a scene may be, and which placement they put first.
#include "apps/ranking.h"

#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "stability/metrics.h"
#include "tests/perception/box_image.h"

namespace dofusion {
namespace {

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

// A cube of unknown shape, seen from +x, that stands on the table at the origin.
RecoveredScene cube_from_the_front(bool known) {
  RecoveredScene recovered;
  const Pose T_world_camera = look_at({0.5, 0.0, 0.3}, {0, 0, 0.025});
  recovered.table = Table{T_world_camera, 0, 0.0};
  const ObjectPtr cube = make_block("cube");
  const BoxImage image = render_boxes({translated(cube->mesh, {0, 0, 0.025})}, test_camera(), T_world_camera, {0.0, 1e-6}, 1);
  recovered.views = {{image.depth, test_camera(), T_world_camera, image.labels}};
  recovered.objects = {{cube, at(0, 0, 0.025), "cube", known, 2, 1000, 1.0}};
  recovered.scene = {{cube}, {at(0, 0, 0.025)}};
  return recovered;
}

double extent(const DrawnScene& drawn, const Eigen::Vector3d& direction) {
  double most = -1.0;
  for (const Eigen::Vector3d& v : drawn.scene.objects[0]->mesh.vertices) {
    most = std::max(most, direction.dot(drawn.scene.T_world_object[0] * v));
  }
  return most;
}

TEST(SceneSampler, KnownShapesStayAndStandAboutWhereTheyAre) {
  const SceneSampler sampler(cube_from_the_front(true), {}, {}, 1);
  std::set<double> places, frictions, volumes;
  for (int i = 0; i < 20; ++i) {
    const DrawnScene drawn = sampler.draw(i);
    EXPECT_EQ(drawn.scene.objects[0]->mesh.vertices.size(), make_block("cube")->mesh.vertices.size());
    EXPECT_LT((drawn.scene.T_world_object[0].translation() - Eigen::Vector3d(0, 0, 0.025)).norm(), 1e-3);
    places.insert(drawn.scene.T_world_object[0].translation().x());
    frictions.insert(drawn.physics.friction);
    volumes.insert(drawn.scene.objects[0]->volume);
  }
  for (const auto& drawn : {places, frictions, volumes}) EXPECT_EQ(drawn.size(), 20u);
}

TEST(SceneSampler, OfAnUnknownShapeTheHiddenSideIsLessCertain) {
  const SceneSampler sampler(cube_from_the_front(false), {}, {}, 1);
  double seen = 0.0, hidden = 0.0;
  for (int i = 0; i < 40; ++i) {
    const DrawnScene drawn = sampler.draw(i);
    seen = std::max(seen, std::abs(extent(drawn, Eigen::Vector3d::UnitX()) - 0.025));
    hidden = std::max(hidden, std::abs(extent(drawn, -Eigen::Vector3d::UnitX()) - 0.025));
    // It stands.
    const SettleResult settled = Simulator(drawn.scene.objects, drawn.physics).settle(drawn.scene.T_world_object);
    EXPECT_TRUE(is_stable(displacement(drawn.scene.objects, drawn.scene.T_world_object, settled.T_world_object)));
  }
  EXPECT_LT(seen, 0.004);  // 4 sigmas of a face and of a shift, and what settling adds
  EXPECT_GT(hidden, seen);
  EXPECT_GT(hidden, 0.004);
}

TEST(SceneSampler, TheSameIndexIsTheSameDraw) {
  const RecoveredScene recovered = cube_from_the_front(false);
  const SceneSampler a(recovered, {}, {}, 5), b(recovered, {}, {}, 5), c(recovered, {}, {}, 6);
  EXPECT_EQ(a.draw(3).scene.T_world_object[0].matrix(), b.draw(3).scene.T_world_object[0].matrix());
  EXPECT_NE(a.draw(3).scene.T_world_object[0].matrix(), c.draw(3).scene.T_world_object[0].matrix());
}

TEST(RankByProbability, WhatDoesNotHangOnTheHiddenSideComesFirst) {
  const SceneSampler sampler(cube_from_the_front(false), {}, {}, 1);
  const ObjectPtr query = make_block("cube");
  // On the cube's hidden edge, 1 mm from falling; beside it on the table; in the air.
  PlacementOptions checking;
  checking.polish = false;
  checking.trials = 0;
  std::vector<Placement> placements =
      check_placements(cube_from_the_front(false).scene, query, {at(-0.024, 0, 0.075), at(0.2, 0, 0.025), at(0.3, 0, 0.3)}, checking);
  rank_by_probability(sampler, query, {}, placements);
  ASSERT_EQ(placements.size(), 3u);
  EXPECT_TRUE(placements[0].T_world_query.isApprox(at(0.2, 0, 0.025)));
  EXPECT_NEAR(*placements[0].stable_probability, 21.0 / 22.0, 1e-12);  // a cube on the table: all 20 draws
  EXPECT_TRUE(placements[1].T_world_query.isApprox(at(-0.024, 0, 0.075)));
  EXPECT_LT(*placements[1].stable_probability, 0.7);
  EXPECT_FALSE(placements[2].stable_probability);  // it does not even stand in the recovered scene
}

TEST(RankByProbability, ThreadsChangeNothingAndWishesComeFirst) {
  const SceneSampler sampler(cube_from_the_front(false), {}, {}, 1);
  const ObjectPtr query = make_block("hat");
  std::vector<Placement> placements = check_placements(
      cube_from_the_front(false).scene, make_block("cube"), {at(0.2, 0, 0.025), at(0.3, 0, 0.025), at(0, 0, 0.075)}, {});
  placements[0].unmet = {"region"};
  std::vector<Placement> many = placements;
  rank_by_probability(sampler, make_block("cube"), {}, placements);
  RankingOptions options;
  options.threads = 3;
  rank_by_probability(sampler, make_block("cube"), options, many);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(placements[i].T_world_query.matrix(), many[i].T_world_query.matrix());
    EXPECT_EQ(placements[i].stable_probability, many[i].stable_probability);
  }
  EXPECT_FALSE(placements[2].unmet.empty());
  EXPECT_FALSE(placements[2].stable_probability);
  options.more = -1;
  EXPECT_THROW(rank_by_probability(sampler, query, options, many), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
