#include "diffusion/sampler.h"

#include <cmath>

#include <gtest/gtest.h>

#include "diffusion/network.h"

namespace dofusion {
namespace {

ModelConfig tiny_config() {
  ModelConfig config;
  config.points = 48;
  config.neighbours = 8;
  config.widths = {32};
  config.embedding = 32;
  config.hidden = 32;
  return config;
}

PlacementModel untrained() {
  const ModelConfig config = tiny_config();
  return PlacementModel(config, make_network(config)->initial_parameters(1));
}

std::vector<PlacementProblem> some_problems(int count) {
  std::vector<PlacementProblem> problems(count);
  for (int i = 0; i < count; ++i) {
    problems[i].query = make_block(i % 2 ? "hat" : "cube");
    problems[i].seed = 100 + i;
    if (i % 3) {
      problems[i].context.objects = {make_block("rectangle")};
      problems[i].context.T_world_object = {make_pose(Eigen::Matrix3d::Identity(), {0.1 * i, 0, 0.05})};
      problems[i].centre = default_centre(problems[i].context);
    }
  }
  return problems;
}

TEST(Sampler, ResultDependsOnTheProblemOnly) {
  const PlacementModel model = untrained();
  const std::vector<PlacementProblem> problems = some_problems(19);
  SamplerOptions options;
  options.steps = 4;
  const std::vector<Pose> together = model.sample(problems, options);
  options.threads = 3;
  const std::vector<Pose> threaded = model.sample(problems, options);
  options.threads = 1;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    EXPECT_EQ(together[i].matrix(), threaded[i].matrix());
    EXPECT_EQ(together[i].matrix(), model.sample({problems[i]}, options)[0].matrix());
  }
}

TEST(Sampler, PosesAreRigid) {
  for (const Pose& pose : untrained().sample(some_problems(5))) {
    EXPECT_TRUE(pose.matrix().allFinite());
    EXPECT_TRUE((pose.linear() * pose.linear().transpose()).isIdentity(1e-9));
    EXPECT_GT(pose.linear().determinant(), 0.0);
  }
}

// The whole process moves with the scene: in x and y there is nothing absolute.
TEST(Sampler, MovesWithTheScene) {
  std::vector<PlacementProblem> here = some_problems(2), there = here;
  const Eigen::Vector3d shift(1.5, -0.5, 0.0);
  for (PlacementProblem& problem : there) {
    for (Pose& pose : problem.context.T_world_object) pose.translation() += shift;
    problem.centre += shift.head<2>();
  }
  SamplerOptions options;
  options.steps = 3;
  const PlacementModel model = untrained();
  const std::vector<Pose> a = model.sample(here, options), b = model.sample(there, options);
  // Coordinates relative to the query are taken before rounding to single precision; neighbours may still swap.
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_LT((b[i].translation() - a[i].translation() - shift).norm(), 1e-3) << i;
}

TEST(Sampler, StartsWhereItIsTold) {
  PlacementProblem problem = some_problems(1)[0];
  problem.start = make_pose(Eigen::Matrix3d::Identity(), {0.2, 0.3, 0.4});
  SamplerOptions options;
  options.start_sigma = 1e-4;
  options.steps = 1;
  const Pose pose = untrained().sample({problem}, options)[0];
  // One step from so little noise cannot lead further than a few times that noise (an untrained output is below 10).
  EXPECT_LT((pose.translation() - problem.start->translation()).norm(), 0.05 * 1e-4 * 50);
}

TEST(Sampler, NonsenseIsRefused) {
  const PlacementModel model = untrained();
  SamplerOptions options;
  options.steps = 0;
  EXPECT_THROW(model.sample(some_problems(1), options), std::invalid_argument);
  options = {};
  options.points = 33;
  EXPECT_THROW(model.sample(some_problems(1), options), std::invalid_argument);
  std::vector<PlacementProblem> problems = some_problems(2);
  problems[1].context.T_world_object[0].translation().x() = std::nan("");
  EXPECT_THROW(model.sample(problems), std::invalid_argument);
  EXPECT_THROW(model.sample({PlacementProblem{}}), std::invalid_argument);
  EXPECT_TRUE(model.sample({}).empty());
}

}  // namespace
}  // namespace dofusion
