// dofusion-train and dofusion-evaluate as a user meets them.
#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "stability/dataset.h"
#include "stability/files.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {
using nlohmann::json;

class TrainTest : public testing::Test {
 protected:
  void SetUp() override {
    expect_success(
        run_command("dofusion-generate", {"--task", "single", "--count", "40", "--out", directory_ / "d.h5"}));
    write_file(directory_ / "small.json",
               R"({"points": 32, "neighbours": 4, "widths": [32], "embedding": 32, "hidden": 32})");
  }
  CommandResult train(std::vector<std::string> arguments, const std::string& data = "d.h5") {
    arguments.insert(arguments.end(), {"--data", directory_ / data, "--config", directory_ / "small.json", "--batch",
                                       "8", "--warm-up", "2", "--threads", "2", "--out", directory_ / "m.safetensors"});
    return run_command("dofusion-train", arguments);
  }
  TemporaryDirectory directory_;
};

TEST_F(TrainTest, ItsModelIsEvaluated) {
  expect_success(train({"--steps", "20", "--json", directory_ / "train.json"}));
  EXPECT_EQ(json::parse(read_file(directory_ / "train.json")).at("steps"), 20);
  const auto evaluate = [&](const std::string& out) {
    return run_command("dofusion-evaluate",
                       {"--table", "single", "--model", directory_ / "m.safetensors", "--instances", "7", "--steps",
                        "3", "--seed", "5", "--json", directory_ / out});
  };
  const CommandResult run = evaluate("e.json");
  expect_success(run);
  EXPECT_THAT(run.out, testing::HasSubstr("Translational Displacement (%)"));
  const json result = json::parse(read_file(directory_ / "e.json"));
  EXPECT_EQ(result.at("table"), "single");
  EXPECT_EQ(result.at("seed"), 5);
  const json& rows = result.at("rows");
  ASSERT_EQ(rows.size(), 48u);  // seven blocks and all, six columns
  EXPECT_EQ(rows[7].at("block"), "All blocks");
  EXPECT_EQ(rows[7].at("instances"), 7);
  EXPECT_EQ(rows[7].at("paper"), 1.2);
  EXPECT_EQ(rows[7].at("paper_random"), 90.7);
  expect_success(evaluate("again.json"));
  EXPECT_EQ(read_file(directory_ / "again.json"), read_file(directory_ / "e.json"));
}

TEST_F(TrainTest, UsesTheTrainingScenesWithoutTheHeldOutShape) {
  write_file(directory_ / "recipe.json", R"({"validation": 0.5, "parts": [{"task": "single", "count": 60}]})");
  expect_success(
      run_command("dofusion-generate", {"--recipe", directory_ / "recipe.json", "--out", directory_ / "half.h5"}));
  DatasetFilter filter;
  filter.split = Split::kTrain;
  filter.without_shape = "hat";
  const std::size_t scenes = read_dataset(directory_ / "half.h5", filter).scenes.size();
  EXPECT_LT(scenes, 50u);
  const CommandResult run = train({"--steps", "2", "--holdout-shape", "hat"}, "half.h5");
  expect_success(run);
  EXPECT_THAT(run.err, testing::HasSubstr(std::to_string(scenes) + " scenes, preset default"));
}

TEST_F(TrainTest, BadInputIsRefused) {
  const std::vector<std::string> before = entries(directory_.path());
  expect_refusal(train({"--steps", "5"}, "none.h5"), {"none.h5", "no such"});
  const std::string whole = read_file(directory_ / "d.h5");
  write_file(directory_ / "cut.h5", whole.substr(0, whole.size() / 2));
  expect_refusal(train({"--steps", "5"}, "cut.h5"), {"cut.h5"});
  expect_refusal(train({"--steps", "5", "--preset", "large"}), {"large"});
  expect_refusal(train({"--steps", "5", "--holdout-shape", "banana"}), {"banana"});
  expect_refusal(train({"--steps", "5", "--resume"}), {"m.safetensors.checkpoint"});
  for (const char* config : {"{", "{\"widths\": \"many\"}", "{\"points\": -4}", "{\"speed\": 1}"}) {
    write_file(directory_ / "small.json", config);
    expect_refusal(train({"--steps", "5"}), {"small.json"});
  }
  std::filesystem::remove(directory_ / "cut.h5");
  EXPECT_EQ(entries(directory_.path()), before);
}

TEST(Evaluate, BadInputIsRefused) {
  const TemporaryDirectory directory;
  expect_refusal(run_command("dofusion-evaluate", {"--table", "chair"}), {"chair"});
  expect_refusal(run_command("dofusion-evaluate", {"--shape", "banana"}), {"banana"});
  expect_refusal(run_command("dofusion-evaluate", {"--instances", "0"}), {"--instances"});
  write_file(directory / "bad.safetensors", "weights");
  expect_refusal(run_command("dofusion-evaluate", {"--model", directory / "bad.safetensors"}), {"bad.safetensors"});
  expect_refusal(
      run_command("dofusion-evaluate", {"--instances", "1", "--steps", "2", "--json", directory / "none/e.json"}),
      {"none/e.json", "cannot be written"});
}

}  // namespace
}  // namespace dofusion
