// Agreement among placements, and which recovered object an estimate means.
#include "apps/refine.h"

#include <cmath>

#include <gtest/gtest.h>

#include "stability/mesh_symmetry.h"

namespace dofusion {
namespace {

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

Placement stable_at(const Pose& pose) {
  Placement placement;
  placement.T_world_query = pose;
  placement.stable = true;
  return placement;
}

TEST(PoseDistance, IsOneAtTheLimitsOfStability) {
  const ObjectPtr cube = make_block("cube");
  const auto symmetries = rotation_symmetries(cube->mesh);
  EXPECT_NEAR(pose_distance(*cube, symmetries, at(0, 0, 0), at(0.1 * cube->diameter, 0, 0)), 1.0, 1e-9);
  EXPECT_NEAR(pose_distance(*cube, symmetries, at(0, 0, 0), make_pose(so3_exp({0, 0, M_PI / 18.0}), {0, 0, 0})), 1.0, 1e-9);
  // A quarter turn of a cube is none.
  EXPECT_NEAR(pose_distance(*cube, symmetries, at(0, 0, 0), make_pose(so3_exp({M_PI / 2.0, 0, 0}), {0, 0, 0})), 0.0, 1e-6);
}

TEST(RankByAgreement, TheMiddleOneOfTheStableOnesComesFirst) {
  std::vector<Placement> placements = {stable_at(at(0.1, 0, 0)), stable_at(at(0.002, 0, 0)), stable_at(at(0, 0, 0)),
                                       stable_at(at(-0.001, 0, 0)), stable_at(at(0.001, 0, 0))};
  placements[2].stable = false;
  rank_by_agreement(*make_block("cube"), at(0.1, 0, 0), placements);
  EXPECT_NEAR(placements[0].T_world_query.translation().x(), 0.001, 1e-12);
  EXPECT_EQ(placements[3].T_world_query.translation().x(), 0.1);
  EXPECT_FALSE(placements[4].stable);
}

TEST(SeenAs, IsTheObjectThatHoldsTheQuery) {
  const ObjectPtr cube = make_block("cube");
  const Scene scene{{cube, cube}, {at(0, 0, 0.025), at(0.06, 0, 0.025)}};
  EXPECT_EQ(seen_as(scene, *cube, at(0.052, 0.004, 0.027)), 1u);
  EXPECT_FALSE(seen_as(scene, *cube, at(0.03, 0.02, 0.025)));  // 24 % of it in each
  EXPECT_FALSE(seen_as(scene, *cube, at(0.0, 0, 0.08)));
  EXPECT_FALSE(seen_as({}, *cube, at(0, 0, 0)));
}

TEST(RemoveObject, TheOthersKeepTheirPixels) {
  RecoveredScene recovered;
  const ObjectPtr cube = make_block("cube"), hat = make_block("hat");
  recovered.objects = {{cube, at(0, 0, 0), "cube", true, 2, 1, 1.0}, {hat, at(1, 0, 0), "hat", true, 3, 1, 1.0}};
  recovered.scene = {{cube, hat}, {at(0, 0, 0), at(1, 0, 0)}};
  recovered.labels = LabelImage(4, 1);
  recovered.labels.pixels = {0, 1, 2, 3};
  remove_object(recovered, 0);
  ASSERT_EQ(recovered.objects.size(), 1u);
  EXPECT_EQ(recovered.objects[0].name, "hat");
  EXPECT_EQ(recovered.objects[0].label, 2);
  EXPECT_EQ(recovered.scene.objects[0], hat);
  EXPECT_EQ(recovered.labels.pixels, (std::vector<std::uint8_t>{0, 1, 0, 2}));
}

}  // namespace
}  // namespace dofusion
