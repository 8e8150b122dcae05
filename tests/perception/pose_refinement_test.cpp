#include "perception/pose_refinement.h"

#include <gtest/gtest.h>

#include "perception/scanner.h"
#include "perception/synthetic_view.h"

namespace dofusion {
namespace {

// A cube on the table, seen without noise, in the true world's frame.
struct CubeScene {
  Camera camera = default_camera();
  ObjectPtr cube = make_block("cube");
  Pose T_world_cube = make_pose(so3_exp({0.0, 0.0, 0.3}), {0.01, -0.02, 0.025});
  Observation seen;

  CubeScene() {
    Table table;
    table.T_world_camera = look_at({0.4, 0.2, 0.5}, {0.0, 0.0, 0.0});
    Scanner scanner({cube});
    scanner.set_poses({T_world_cube});
    const Scan scan = scanner.render(camera, table.T_world_camera);
    DepthSigma sigma;
    sigma.quadratic = 2e-3;
    seen = observe(scan.depth, camera, table, scan.labels, {200, 120, 440, 360, 1}, sigma);
  }
};

TEST(PoseScore, TheTruthExplainsAllPixels) {
  CubeScene scene;
  PoseScorer scorer(scene.seen);
  const Explanation empty = scorer.empty_scene();
  const PixelCounts counts = scorer.count(empty, scene.cube->mesh, scene.T_world_cube);
  EXPECT_GT(counts.explained, 1000);
  EXPECT_EQ(counts.nearer + counts.behind + counts.missing, 0);
}

TEST(PoseScore, GainIsTheDifferenceOfTotalCosts) {
  CubeScene scene;
  PoseScorer scorer(scene.seen);
  const Explanation empty = scorer.empty_scene();
  const Pose off = moved(scene.T_world_cube, {0.003, 0.001, 0.0}, {0.0, 0.0, 0.1});
  Explanation with_cube = empty;
  scorer.add(scene.cube->mesh, off, with_cube);
  // Sums of some thousand floats in another order.
  EXPECT_NEAR(scorer.gain(empty, scene.cube->mesh, off), total_cost(empty) - total_cost(with_cube), 0.05);
  EXPECT_GT(scorer.gain(empty, scene.cube->mesh, scene.T_world_cube), scorer.gain(empty, scene.cube->mesh, off));
}

TEST(PoseScore, AnObjectInFreeSpaceContradictsTheReadings) {
  CubeScene scene;
  PoseScorer scorer(scene.seen);
  const Pose in_the_air = moved(scene.T_world_cube, {0.0, 0.0, 0.1}, Eigen::Vector3d::Zero());
  EXPECT_LT(scorer.gain(scorer.empty_scene(), scene.cube->mesh, in_the_air), -1000.0);
}

// Three faces are seen, which fixes all six degrees of freedom. Gauss-Newton from 4 mm and 4 degrees: what remains is
// pairing across outlines, far below 0.1 mm.
TEST(PoseRefinement, AlignmentFindsTheTruth) {
  CubeScene scene;
  PoseScorer scorer(scene.seen);
  const Pose start = moved(scene.T_world_cube, {0.003, -0.002, 0.002}, {0.03, -0.04, 0.05});
  const Pose found =
      align_to_readings(scorer, scorer.empty_scene(), scene.cube->mesh, start, Freedom::kFree, {25, 0.02, 0.002});
  EXPECT_LT((found.translation() - scene.T_world_cube.translation()).norm(), 1e-4);
  EXPECT_LT(rotation_angle(found.linear().transpose() * scene.T_world_cube.linear()), 2e-3);
}

TEST(PoseRefinement, RestingObjectsKeepHeightAndTilt) {
  CubeScene scene;
  PoseScorer scorer(scene.seen);
  const Pose start = moved(scene.T_world_cube, {0.004, -0.003, 0.0}, {0.0, 0.0, 0.05});
  const Pose found =
      align_to_readings(scorer, scorer.empty_scene(), scene.cube->mesh, start, Freedom::kResting, {25, 0.02, 0.002});
  EXPECT_EQ(found.translation().z(), start.translation().z());
  EXPECT_NEAR(found.linear()(2, 2), 1.0, 1e-12);
  EXPECT_LT((found.translation() - scene.T_world_cube.translation()).norm(), 1e-4);
}

// A smooth function with its maximum at a known pose: the last step is 0.1 mm, so that is the error along each axis.
TEST(PoseRefinement, ClimbReachesAMaximum) {
  const Pose goal = make_pose(so3_exp({0.02, 0.01, -0.03}), {0.005, -0.003, 0.002});
  const PoseObjective objective = [&](const Pose& pose) {
    const Pose off = goal.inverse() * pose;
    return -off.translation().squaredNorm() - 0.04 * 0.04 * so3_log(off.linear()).squaredNorm();
  };
  const ScoredPose found =
      climb(objective, {Pose::Identity(), objective(Pose::Identity())}, Freedom::kFree, 0.04, {0.004, 0.0001, 10});
  EXPECT_LT((found.T_world_object.translation() - goal.translation()).norm(), 2e-4);
  EXPECT_LT(rotation_angle(found.T_world_object.linear().transpose() * goal.linear()), 5e-3);
  EXPECT_EQ(found.score, objective(found.T_world_object));
}

}  // namespace
}  // namespace dofusion
