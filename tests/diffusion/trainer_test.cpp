#include "diffusion/trainer.h"

#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <thread>

#include <gmock/gmock.h>

#include "diffusion/sampler.h"
#include "diffusion/se3_noise.h"
#include "diffusion/weights.h"
#include "stability/files.h"
#include "tests/diffusion/toy_scenes.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using testing::HasSubstr;

ModelConfig small_config() {
  ModelConfig config;
  config.points = 48;
  config.neighbours = 8;
  config.widths = {32, 64};
  config.embedding = 128;
  config.hidden = 128;
  return config;
}

class TrainerTest : public testing::Test {
 protected:
  void SetUp() override {
    options_.out = folder_ / "model.safetensors";
    options_.batch = 16;
    options_.warm_up = 10;
    options_.steps = 12;
  }
  TemporaryDirectory folder_;
  TrainOptions options_;
};

TEST_F(TrainerTest, ResumedTrainingFollowsTheSameCurve) {
  const TrainingSet data({boxes_on_table(50, 1)}, small_config());
  const TrainResult whole = train(data, small_config(), options_, "");
  ASSERT_TRUE(whole.finished);
  const std::vector<float> parameters = read_model(options_.out).parameters;

  options_.out = folder_ / "halves.safetensors";
  int steps = 0;
  const TrainResult first =
      train(data, small_config(), options_, "", {{}, [&](const TrainReport&) { return ++steps < 5; }, {}});
  EXPECT_FALSE(first.finished);
  options_.resume = true;
  const TrainResult second = train(data, small_config(), options_, "");
  EXPECT_TRUE(second.finished);
  std::vector<float> losses = first.losses;
  losses.insert(losses.end(), second.losses.begin(), second.losses.end());
  EXPECT_EQ(losses, whole.losses);
  EXPECT_EQ(read_model(options_.out).parameters, parameters);
}

TEST_F(TrainerTest, SeveralThreadsGiveTheSameLossesUpToRounding) {
  const TrainingSet data({boxes_on_table(50, 1)}, small_config());
  const TrainResult one = train(data, small_config(), options_, "");
  options_.threads = 3;
  options_.micro_batch = 4;
  const TrainResult three = train(data, small_config(), options_, "");
  // Sums in another order differ by some 1e-7, which Adam's first steps magnify where gradients are tiny.
  for (std::size_t i = 0; i < one.losses.size(); ++i) EXPECT_NEAR(three.losses[i], one.losses[i], 0.02f) << i;
}

// Processes that are threads: sums through shared memory.
class ThreadPeers : public Peers {
 public:
  struct Meeting {
    std::mutex mutex;
    std::condition_variable changed;
    std::vector<float> sum;
    int arrived = 0, round = 0;
  };
  ThreadPeers(int rank, int count, Meeting& meeting) : rank_(rank), count_(count), meeting_(meeting) {}
  int rank() const override { return rank_; }
  int count() const override { return count_; }
  void sum(std::vector<float>& values) override {
    std::unique_lock<std::mutex> lock(meeting_.mutex);
    const int round = meeting_.round;
    if (meeting_.arrived == 0) meeting_.sum.assign(values.size(), 0.0f);
    for (std::size_t i = 0; i < values.size(); ++i) meeting_.sum[i] += values[i];
    if (++meeting_.arrived == count_) {
      meeting_.arrived = 0;
      ++meeting_.round;
      result_ = meeting_.sum;
      for (ThreadPeers* other : others) other->result_ = meeting_.sum;
      meeting_.changed.notify_all();
    } else {
      meeting_.changed.wait(lock, [&] { return meeting_.round != round; });
    }
    values = result_;
  }
  std::vector<ThreadPeers*> others;

 private:
  int rank_, count_;
  Meeting& meeting_;
  std::vector<float> result_;
};

TEST_F(TrainerTest, TwoProcessesFollowTheCurveOfOneWithTwiceTheBatch) {
  const TrainingSet data({boxes_on_table(50, 1)}, small_config());
  const auto train_two = [&](TrainOptions options, int steps_until_stop) {
    ThreadPeers::Meeting meeting;
    ThreadPeers first(0, 2, meeting), second(1, 2, meeting);
    first.others = {&second};
    second.others = {&first};
    int steps = 0;
    TrainCallbacks stops;
    stops.keep_going = [&](const TrainReport&) { return ++steps < steps_until_stop; };
    std::thread other([&] { train(data, small_config(), options, "", {}, &second); });
    const TrainResult result = train(data, small_config(), options, "", stops, &first);
    other.join();
    return result;
  };
  const TrainResult alone = train(data, small_config(), options_, "");
  options_.out = folder_ / "two.safetensors";
  options_.batch = 8;
  const TrainResult two = train_two(options_, 1000);
  ASSERT_EQ(two.losses.size(), alone.losses.size());
  for (std::size_t i = 0; i < alone.losses.size(); ++i) EXPECT_NEAR(two.losses[i], alone.losses[i], 0.02f) << i;

  // One that stops both, and goes on with both from the file of the first.
  options_.out = folder_ / "halves.safetensors";
  const TrainResult half = train_two(options_, 5);
  EXPECT_FALSE(half.finished);
  options_.resume = true;
  const TrainResult rest = train_two(options_, 1000);
  EXPECT_TRUE(rest.finished);
  std::vector<float> losses = half.losses;
  losses.insert(losses.end(), rest.losses.begin(), rest.losses.end());
  EXPECT_EQ(losses, two.losses);
}

TEST_F(TrainerTest, ValidationIsLogged) {
  const TrainingSet data({boxes_on_table(20, 1)}, small_config());
  TrainCallbacks callbacks;
  std::size_t parameters = 0;
  callbacks.validate = [&](const ModelConfig&, const std::vector<float>& p) {
    parameters = p.size();
    return 0.625;
  };
  const TrainResult result = train(data, small_config(), options_, "", callbacks);
  EXPECT_EQ(parameters, read_model(options_.out).parameters.size());
  EXPECT_EQ(result.last.validation, 0.625);
  EXPECT_THAT(read_file(options_.out + ".csv"), HasSubstr(",0.625\n"));
  EXPECT_THAT(read_model(options_.out).training, HasSubstr("\"validation\":0.625"));
}

TEST_F(TrainerTest, CheckpointOfAnotherRunIsRefused) {
  const TrainingSet data({boxes_on_table(50, 1)}, small_config());
  train(data, small_config(), options_, "");
  options_.resume = true;
  options_.seed = 9;
  try {
    train(data, small_config(), options_, "");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("another configuration, seed or batch size"));
  }
  ModelConfig other = small_config();
  other.hidden = 64;
  EXPECT_THROW(train(data, other, options_, ""), InputError);
  std::filesystem::resize_file(options_.out + ".checkpoint", 1000);
  EXPECT_THROW(train(data, small_config(), options_, ""), InputError);
}

TEST_F(TrainerTest, BeginsWithGivenParameters) {
  const TrainingSet data({boxes_on_table(50, 1)}, small_config());
  train(data, small_config(), options_, "");
  options_.parameters = read_model(options_.out).parameters;
  options_.optimizer.learning_rate = 0.0;
  options_.optimizer.weight_decay = 0.0;
  train(data, small_config(), options_, "");
  const std::vector<float> after = read_model(options_.out).parameters;  // their running mean: the same but for rounding
  for (std::size_t i = 0; i < after.size(); ++i) ASSERT_NEAR(after[i], options_.parameters[i], 1e-5f) << i;
  options_.parameters.pop_back();
  EXPECT_THROW(train(data, small_config(), options_, ""), InputError);
}

TEST_F(TrainerTest, BadOutputAndBudgetAreRefused) {
  const TrainingSet data({boxes_on_table(5, 1)}, small_config());
  TrainOptions no_budget = options_;
  no_budget.steps = 0;
  EXPECT_THROW(train(data, small_config(), no_budget, ""), InputError);
  options_.out = folder_ / "missing/model.safetensors";
  EXPECT_THROW(train(data, small_config(), options_, ""), InputError);
}

TEST_F(TrainerTest, DivergenceStopsAndKeepsTheLastGoodState) {
  const TrainingSet data({boxes_on_table(50, 1)}, small_config());
  options_.optimizer.learning_rate = 1e30;
  options_.warm_up = 0;
  options_.steps = 200;
  try {
    train(data, small_config(), options_, "");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("not finite"));
  }
  EXPECT_NO_THROW(read_model(options_.out));
}

// What stands around the query is shown where it is not, by as much as is asked for; the target stays.
TEST_F(TrainerTest, PerceptionNoiseMovesTheOthersAlone) {
  SceneDataset dataset;
  dataset.shapes = {make_block("cube")};
  SceneRecord record;
  record.objects.resize(2);
  record.objects[0].T_world_object = make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.025});
  record.objects[1].T_world_object = make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.075});
  record.task = Task::kStack;  // the upper one is the query
  dataset.scenes = {record};
  const auto lowest_of_context = [&](double noise, std::uint64_t example) {
    ModelConfig config = small_config();
    config.sigma_min = 0.0099;
    config.sigma_max = 0.01;
    config.perception_noise = noise;
    const TrainingSet data({dataset}, config);
    NetworkInput input;
    std::vector<float> target;
    data.append(1, example, input, target);
    float lowest = 1e9f;
    for (int i = 0; i < input.points; ++i) {
      const float* point = &input.cloud[static_cast<std::size_t>(i * kCloudChannels)];
      if (point[4] == 0.0f) lowest = std::min(lowest, point[2]);
    }
    for (const float t : target) EXPECT_LT(std::abs(t), 6.0f);  // the added noise alone
    return lowest;
  };
  double sum = 0.0;
  for (std::uint64_t i = 0; i < 100; ++i) {
    EXPECT_NEAR(lowest_of_context(0.0, i), 0.0f, 1e-4f);
    sum += std::abs(lowest_of_context(0.1, i));
  }
  EXPECT_GT(sum / 100, 0.05);
  EXPECT_LT(sum / 100, 0.25);
}

// Of a cube's 24 equal poses one is never farther than 62.8 degrees; a cylinder's nearest one differs in its axis
// alone, at most 90 degrees. Without the option targets go all the way.
TEST_F(TrainerTest, TargetsAreTheNearestOfEqualPoses) {
  for (const ObjectPtr& shape : {make_block("cube"), make_cylinder("can", 0.03, 0.05)}) {
    SceneDataset dataset;
    dataset.shapes = {shape};
    SceneRecord record;
    SceneObject object;
    object.T_world_object = make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.025});
    record.objects = {object};
    dataset.scenes = {record};
    const double limit = shape->name == "cube" ? 62.9 : 90.1;
    for (const bool equivalent : {false, true}) {
      ModelConfig config = small_config();
      config.equivalent = equivalent;
      config.sigma_min = 1.9;
      config.sigma_max = 2.0;
      const TrainingSet data({dataset}, config);
      double largest = 0.0;
      for (std::uint64_t i = 0; i < 500; ++i) {
        NetworkInput input;
        std::vector<float> target;
        data.append(1, i, input, target);
        const Eigen::Vector3d turn(target[3], target[4], target[5]);
        largest = std::max(largest, turn.norm() * rotation_scale(input.sigma[0]) * 180.0 / M_PI);
      }
      if (equivalent)
        EXPECT_LT(largest, limit) << shape->name;
      else
        EXPECT_GT(largest, 150.0) << shape->name;
    }
  }
}

TEST_F(TrainerTest, OfAStackTheTopIsTheQueryAndElseAnyObject) {
  ModelConfig config = small_config();
  config.sigma_min = 1e-4;
  config.sigma_max = 2e-4;
  SceneDataset scenes = stacked_cubes(20, 1);
  for (const bool stacks : {true, false}) {
    for (SceneRecord& record : scenes.scenes) record.task = stacks ? Task::kStack : Task::kUnstructured;
    const TrainingSet data({scenes}, config);
    int tops = 0;
    for (std::uint64_t i = 0; i < 100; ++i) {
      NetworkInput input;
      std::vector<float> target;
      data.append(1, i, input, target);
      tops += input.pose.back() > 1.0f;  // the height in cube edges: 0.5 or 1.5
    }
    EXPECT_NEAR(tops, stacks ? 100 : 50, stacks ? 0 : 25);  // five standard errors
  }
}

TEST_F(TrainerTest, ScenesOfMoreObjectsAreDrawnMoreOften) {
  ModelConfig config = small_config();
  config.sigma_min = 1e-4;
  config.sigma_max = 2e-4;
  const TrainingSet data({boxes_on_table(500, 1), stacked_cubes(3, 1)}, config);  // of one and of two objects
  constexpr int kDraws = 900;
  int two = 0;
  for (std::uint64_t i = 0; i < kDraws; ++i) {
    NetworkInput input;
    std::vector<float> target;
    data.append(1, i, input, target);
    two += input.pose.back() > 1.0f;  // the top of a stack
  }
  EXPECT_NEAR(two / double(kDraws), 2.0 / 3.0, 0.08);  // five standard errors
}

TEST_F(TrainerTest, BadDataIsRefused) {
  EXPECT_THROW(TrainingSet({}, small_config()), InputError);
  EXPECT_THROW(TrainingSet({boxes_on_table(0, 1)}, small_config()), InputError);
  SceneDataset broken = boxes_on_table(3, 1);
  broken.scenes[1].objects[0].T_world_object.translation().x() = std::nan("");
  EXPECT_THROW(TrainingSet({broken}, small_config()), InputError);
}

TEST_F(TrainerTest, ScenesOfAllDatasetsAreUsed) {
  const TrainingSet data({boxes_on_table(7, 1), stacked_cubes(5, 1)}, small_config());
  EXPECT_EQ(data.scenes(), 12u);
}

// A box that always lies on its largest face: the model must find the height and which way is up.
TEST_F(TrainerTest, LearnsToLayABoxOnTheTable) {
  const ModelConfig config = small_config();
  const TrainingSet data({boxes_on_table(2000, 1)}, config);
  options_.batch = 64;
  options_.steps = 700;
  options_.warm_up = 50;
  options_.threads = 2;
  options_.optimizer.learning_rate = 3e-3;
  options_.optimizer.average = 0.99;
  const TrainResult result = train(data, config, options_, "");
  EXPECT_LT(result.last.loss, 0.75);

  const PlacementModel model = PlacementModel::load(options_.out);
  std::vector<PlacementProblem> problems(50);
  const ObjectPtr box = make_box("box", {0.06, 0.10, 0.04});
  for (std::size_t i = 0; i < problems.size(); ++i) {
    problems[i].query = box;
    problems[i].seed = i;
  }
  SamplerOptions options;
  options.threads = 2;
  const std::vector<Pose> poses = model.sample(problems, options);
  int right = 0;
  for (const Pose& pose : poses) {
    const double height_error = std::abs(pose.translation().z() - 0.02);
    const double tilt = std::acos(std::min(1.0, std::abs(pose.linear()(2, 2))));
    right += height_error < 0.004 && tilt < 0.1;
  }
  EXPECT_GE(right, 45) << "of 50";  // a uniformly random orientation is right one time in 200
}

}  // namespace
}  // namespace dofusion
