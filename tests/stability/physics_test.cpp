#include "stability/physics.h"

#include <gtest/gtest.h>

#include "stability/metrics.h"
#include "stability/resting_poses.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

TEST(Simulator, EveryBlockRestsOnEachOfItsFaces) {
  for (const ObjectPtr& block : all_blocks()) {
    const Simulator simulator({block});
    for (const RestingPose& rest : resting_poses(block->mesh)) {
      const std::vector<Pose> start = {make_pose(rest.R_world_object, {0, 0, rest.height})};
      const SettleResult result = simulator.settle(start);
      EXPECT_EQ(result.status, SettleStatus::kSettled) << block->name;
      const Displacement moved = displacement({block}, start, result.T_world_object);
      EXPECT_LT(moved.translation_pct, 0.1) << block->name;  // soft contacts sink by hundredths of a per cent
      EXPECT_LT(moved.rotation_deg, 0.1) << block->name;
    }
  }
}

TEST(Simulator, ATiltedBoxFallsAndATowerOfTwoStands) {
  const ObjectPtr tall = make_block("rectangle");
  const Simulator one({tall});
  const Pose tilted = make_pose(so3_exp({0.6, 0, 0}), {0, 0, 0.065});
  const SettleResult fallen = one.settle({tilted});
  EXPECT_EQ(fallen.status, SettleStatus::kSettled);
  EXPECT_GT(displacement({tall}, {tilted}, fallen.T_world_object).rotation_deg, 25.0);

  const ObjectPtr cube = make_block("cube");
  const Simulator two({cube, tall});
  const std::vector<Pose> tower = {at(0, 0, 0.025), at(0.005, 0, 0.1)};
  const SettleResult standing = two.settle(tower);
  EXPECT_TRUE(is_stable(displacement({cube, tall}, tower, standing.T_world_object)));
  const std::vector<std::pair<int, int>> expected = {{-1, 0}, {0, 1}};
  EXPECT_EQ(standing.touching, expected);
}

TEST(Simulator, ASettledSceneStays) {
  // Measured: below 1e-4 % and 1e-4 degrees for scenes of boxes; prisms on prisms up to 0.02 % and 0.03 degrees.
  const std::vector<ObjectPtr> objects = {make_block("tall_triangle"), make_block("hat"), make_block("tetrahedron")};
  const Simulator simulator(objects);
  Rng rng = make_rng(11);
  for (int i = 0; i < 10; ++i) {
    std::vector<Pose> start;
    for (int k = 0; k < 3; ++k) {
      start.push_back(make_pose(random_rotation(rng), {uniform(rng, -0.03, 0.03), uniform(rng, -0.03, 0.03), 0.07 + 0.1 * k}));
    }
    const SettleResult first = simulator.settle(start);
    if (first.status != SettleStatus::kSettled) continue;
    const SettleResult second = simulator.settle(first.T_world_object);
    const Displacement moved = displacement(objects, first.T_world_object, second.T_world_object);
    EXPECT_LT(moved.translation_pct, 0.3);
    EXPECT_LT(moved.rotation_deg, 0.3);
  }
}

TEST(Simulator, FrictionHoldsOnAGentleSlopeOnly) {
  // A cube on the side of a wedge: tan(26.6°) = 0.5 is below the friction of 0.8 and above one of 0.3.
  const ObjectPtr wedge = make_object("wedge", prism_mesh({{-0.2, 0}, {0.2, 0}, {-0.2, 0.2}}, -0.1, 0.1)).object;
  const Pose lying = make_pose(so3_exp({M_PI / 2, 0, 0}), Vector3d::Zero());
  const double height = -(lying.linear() * Vector3d(0, bounding_box(wedge->mesh).min.y(), 0)).z();
  const Pose T_wedge = make_pose(lying.linear(), {0, 0, height});
  const double slope = std::atan(0.5);
  const ObjectPtr cube = make_block("cube", 0.6);
  // The middle of the slope in the wedge's frame, lifted by half a cube along its normal.
  const Vector3d normal_wedge(std::sin(slope), std::cos(slope), 0);
  const Vector3d corner(bounding_box(wedge->mesh).min.x(), bounding_box(wedge->mesh).max.y(), 0);
  const Vector3d middle = corner + Vector3d(0.2, -0.1, 0);
  Pose T_cube = T_wedge * make_pose(Eigen::Matrix3d::Identity(), middle + 0.015 * normal_wedge);
  T_cube.linear() = so3_exp({0, slope, 0});
  for (const double friction : {0.8, 0.3}) {
    PhysicsOptions options;
    options.friction = friction;
    const Simulator simulator({wedge, cube}, options);
    const SettleResult result = simulator.settle({T_wedge, T_cube});
    const Displacement moved = displacement({wedge, cube}, {T_wedge, T_cube}, result.T_world_object);
    EXPECT_EQ(moved.translation_pct < 2.0, friction > 0.5) << moved.translation_pct << " % at friction " << friction;
  }
}

TEST(Simulator, ReportsInitialPenetration) {
  const Simulator simulator({make_block("cube")});
  EXPECT_NEAR(simulator.settle({at(0, 0, 0.023)}).initial_penetration, 0.002, 1e-6);
  EXPECT_NEAR(simulator.settle({at(0, 0, 0.03)}).initial_penetration, 0.0, 1e-12);
}

TEST(Simulator, PenetrationOfTwoBoxesIsTheOverlapWhateverTouches) {
  const Simulator cubes({make_block("cube"), make_block("cube")});
  const double h = 0.025 * std::sqrt(2.0), overlap = 0.004;
  const auto turned = [](const Eigen::Vector3d& w, double z) { return make_pose(so3_exp(w), {0.003, 0.002, z}); };
  const Pose face = turned({0, 0, 0.3}, 0.2), edge_y = turned({0, M_PI / 4, 0}, 0.2);
  EXPECT_NEAR(cubes.settle({face, turned({0, 0, 0.1}, 0.25 - overlap)}).initial_penetration, overlap, 1e-6);
  EXPECT_NEAR(cubes.settle({face, turned({M_PI / 4, 0, 0}, 0.225 + h - overlap)}).initial_penetration, overlap, 1e-6);
  EXPECT_NEAR(cubes.settle({edge_y, turned({M_PI / 4, 0, 0}, 0.2 + 2 * h - overlap)}).initial_penetration, overlap, 1e-6);
}

TEST(Simulator, RefusesWrongCountsAndBadPoses) {
  const Simulator simulator({make_block("cube")});
  EXPECT_THROW(simulator.settle({}), std::invalid_argument);
  EXPECT_THROW(simulator.settle({at(0, 0, std::nan(""))}), std::invalid_argument);
}

TEST(SimulatorCache, GivesTheSameModelAgainAndForgetsTheOldest) {
  SimulatorCache cache({}, 2);
  const ObjectPtr cube = make_block("cube"), hat = make_block("hat");
  const Simulator* first = &cache.get({cube});
  EXPECT_EQ(first, &cache.get({cube}));
  cache.get({hat});
  EXPECT_EQ(first, &cache.get({cube}));  // used again, so {hat} is now the oldest
  cache.get({cube, hat});
  EXPECT_EQ(first, &cache.get({cube}));
}

}  // namespace
}  // namespace dofusion
