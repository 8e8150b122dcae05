#include <filesystem>
#include <numeric>

#include <gtest/gtest.h>

#include "diffusion/sampler.h"
#include "diffusion/torch_network.h"
#include "diffusion/trainer.h"
#include "diffusion/weights.h"
#include "tests/diffusion/toy_scenes.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

ModelConfig small_paper_config() {
  ModelConfig config = make_config(Preset::kPaper);
  config.points = 48;
  config.neighbours = 6;
  config.widths = {16, 16};
  config.embedding = 32;
  config.hidden = 32;
  return config;
}

class PaperNetworkTest : public testing::Test {
 protected:
  void SetUp() override {
    enable_torch_networks(1);
    options_.out = folder_ / "paper.safetensors";
    options_.batch = 32;
    options_.warm_up = 10;
    options_.steps = 8;
  }
  TemporaryDirectory folder_;
  TrainOptions options_;
};

TEST_F(PaperNetworkTest, PresetIsThePapers) {
  const ModelConfig config = make_config(Preset::kPaper);
  EXPECT_EQ(config.neighbours, 20);
  EXPECT_EQ(config.embedding, 512);
  EXPECT_EQ(config.point_features(), 5);
  EXPECT_EQ(config.pose_features(), 6);
  const auto network = make_network(config);
  EXPECT_EQ(network->tensors().front().shape, (std::vector<std::int64_t>{10, 64}));  // of [x_i, x_j - x_i]
}

TEST_F(PaperNetworkTest, LossFallsAndItsModelSamples) {
  const TrainingSet data({boxes_on_table(200, 1), stacked_cubes(200, 2)}, small_paper_config());
  options_.steps = 300;
  options_.optimizer.learning_rate = 3e-3;
  const TrainResult result = train(data, small_paper_config(), options_, "");
  const auto mean = [&](std::size_t from, std::size_t to) {
    return std::accumulate(result.losses.begin() + from, result.losses.begin() + to, 0.0) / double(to - from);
  };
  const std::size_t n = result.losses.size();
  EXPECT_LT(mean(n - 30, n), 0.9);  // 1 is what predicting nothing costs
  EXPECT_LT(mean(n - 30, n), 0.8 * mean(0, 10));

  const PlacementModel model = PlacementModel::load(options_.out);
  PlacementProblem problem;
  problem.query = make_block("cube");
  SamplerOptions sampler;
  sampler.steps = 5;
  const std::vector<Pose> poses = model.sample({problem, problem}, sampler);
  EXPECT_TRUE(poses[0].matrix().allFinite());
  EXPECT_EQ(poses[0].matrix(), poses[1].matrix());  // same seed
}

TEST_F(PaperNetworkTest, ResumedTrainingFollowsTheSameCurve) {
  const TrainingSet data({boxes_on_table(50, 1)}, small_paper_config());
  const TrainResult whole = train(data, small_paper_config(), options_, "");
  options_.out = folder_ / "halves.safetensors";
  int steps = 0;
  const TrainResult first =
      train(data, small_paper_config(), options_, "", {{}, [&](const TrainReport&) { return ++steps < 3; }, {}});
  options_.resume = true;
  const TrainResult second = train(data, small_paper_config(), options_, "");
  std::vector<float> losses = first.losses;
  losses.insert(losses.end(), second.losses.begin(), second.losses.end());
  EXPECT_EQ(losses, whole.losses);
}

}  // namespace
}  // namespace dofusion
