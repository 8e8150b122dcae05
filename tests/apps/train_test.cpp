// dofusion-train and dofusion-evaluate as a user meets them.
#include <filesystem>
#include <sstream>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "diffusion/weights.h"
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
  ASSERT_EQ(rows.size(), 56u);  // seven blocks and all, seven columns
  EXPECT_EQ(rows[7].at("block"), "All");
  EXPECT_EQ(rows[7].at("instances"), 7);
  EXPECT_EQ(rows[7].at("paper"), 1.2);
  EXPECT_EQ(rows[7].at("paper_random"), 90.7);
  expect_success(evaluate("again.json"));
  EXPECT_EQ(json::parse(read_file(directory_ / "again.json")).at("rows"), rows);
  EXPECT_THAT(read_file(directory_ / "m.safetensors.svg"), testing::HasSubstr("Loss by noise"));
}

// Its configuration and its weights are the beginning; what it came from is in the file.
TEST_F(TrainTest, GoesOnFromAModel) {
  expect_success(train({"--steps", "20"}));
  const std::string out = directory_ / "tuned.safetensors";
  const std::vector<std::string> arguments = {"--data",          directory_ / "d.h5",
                                              "--from",          directory_ / "m.safetensors",
                                              "--steps",         "2",
                                              "--learning-rate", "1e-8",
                                              "--out",           out};
  expect_success(run_command("dofusion-train", arguments));
  const ModelFile before = read_model(directory_ / "m.safetensors"), after = read_model(out);
  EXPECT_EQ(to_json(after.config), to_json(before.config));
  for (std::size_t i = 0; i < before.parameters.size(); ++i)
    ASSERT_NEAR(after.parameters[i], before.parameters[i], 1e-6) << i;
  EXPECT_EQ(json::parse(after.training).at("from"), "m.safetensors");

  const auto train_with = [&](const std::string& option, const std::string& value) {
    std::filesystem::remove(out);
    std::vector<std::string> more = arguments;
    more.insert(more.end(), {option, value});
    return run_command("dofusion-train", more);
  };
  expect_refusal(train_with("--preset", "paper"), {"--from", "--preset"});
  write_file(directory_ / "wide.json", R"({"hidden": 64})");
  expect_refusal(train_with("--config", directory_ / "wide.json"), {"wide.json", "m.safetensors"});
  write_file(directory_ / "noisy.json", R"({"perception_noise": 0.02})");
  expect_success(train_with("--config", directory_ / "noisy.json"));
  EXPECT_EQ(read_model(out).config.perception_noise, 0.02);
  write_file(directory_ / "m.safetensors", "weights");
  std::filesystem::remove(out);
  expect_refusal(run_command("dofusion-train", arguments), {"m.safetensors"});
}

// Models of held-out shapes and without parts of the input stand beside one another; each file knows what it is.
TEST_F(TrainTest, ModelsOfAllKindsAreEvaluatedTogether) {
  const auto train_as = [&](const std::string& name, const std::string& config, std::vector<std::string> arguments) {
    write_file(directory_ / "small.json", config);
    arguments.insert(arguments.end(), {"--data", directory_ / "d.h5", "--config", directory_ / "small.json", "--batch",
                                       "8", "--steps", "2", "--validation", "0", "--out", directory_ / name});
    expect_success(run_command("dofusion-train", arguments));
  };
  const std::string sizes = R"("points": 32, "neighbours": 4, "widths": [32], "embedding": 32, "hidden": 32)";
  train_as("full", "{" + sizes + "}", {});
  train_as("hat", "{" + sizes + "}", {"--holdout-shape", "hat"});
  train_as("sdf", "{" + sizes + R"(, "use_sdf": false})", {});
  const auto evaluate = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--instances", "4", "--steps", "2", "--json", directory_ / "e.json"});
    return run_command("dofusion-evaluate", arguments);
  };
  const std::string full = directory_ / "full", hat = directory_ / "hat", sdf = directory_ / "sdf";
  expect_success(evaluate({"--table", "single", "--shape", "hat", "--best-of", "2", "--model", full, hat}));
  json result = json::parse(read_file(directory_ / "e.json"));
  EXPECT_TRUE(result.at("rows")[0].at("dofusion").is_number());
  EXPECT_TRUE(result.at("rows")[0].at("dofusion_ood").is_number());
  EXPECT_EQ(result.at("models")[1].at("held_out"), "hat");
  EXPECT_EQ(result.at("best_of"), 2);
  EXPECT_GE(result.at("held_out_data").at("contact_entropy_bits"), 0.0);

  expect_success(evaluate({"--table", "ablation", "--context", "1", "--model", sdf, full}));
  result = json::parse(read_file(directory_ / "e.json"));
  ASSERT_EQ(result.at("rows").size(), 6u);  // two variants, three columns
  EXPECT_EQ(result.at("rows")[0].at("block"), "full");
  EXPECT_EQ(result.at("rows")[0].at("paper_ood"), 18.6);
  EXPECT_EQ(result.at("rows")[1].at("block"), "w/o SDF");
  EXPECT_EQ(result.at("rows")[1].at("paper"), 18.5);

  expect_success(evaluate({"--table", "unstructured", "--shapes", "general", "--context", "1", "--model", full}));
  EXPECT_EQ(json::parse(read_file(directory_ / "e.json")).at("rows").size(), 7u);  // all, seven columns

  expect_refusal(evaluate({"--table", "single", "--model", full, full}), {"is for the same as"});
  expect_refusal(evaluate({"--table", "single", "--model", full, sdf}), {"--table ablation"});
  expect_refusal(evaluate({"--table", "single", "--model", hat}), {"no model has never seen"});
  expect_refusal(evaluate({"--shapes", "general", "--shape", "hat"}), {"needs scenes of blocks"});
}

// Two processes through Gloo on this machine: the losses of one with twice the batch.
TEST_F(TrainTest, TwoProcessesTrainTogether) {
  const auto arguments = [&](const std::string& name, const std::string& batch, const std::string& rank) {
    std::vector<std::string> list = {"--data",
                                     directory_ / "d.h5",
                                     "--config",
                                     directory_ / "small.json",
                                     "--batch",
                                     batch,
                                     "--steps",
                                     "6",
                                     "--warm-up",
                                     "2",
                                     "--threads",
                                     "1",
                                     "--report-seconds",
                                     "0",
                                     "--validation",
                                     "0",
                                     "--out",
                                     directory_ / name};
    if (!rank.empty())
      list.insert(list.end(), {"--world-size", "2", "--rank", rank, "--rendezvous", "127.0.0.1:29617"});
    return list;
  };
  expect_success(run_command("dofusion-train", arguments("one", "8", "")));
  CommandResult second;
  std::thread other([&] { second = run_command("dofusion-train", arguments("two", "4", "1")); });
  const CommandResult first = run_command("dofusion-train", arguments("two", "4", "0"));
  other.join();
  if (first.err.find("built without") != std::string::npos) GTEST_SKIP() << first.err;
  expect_success(first);
  expect_success(second);
  const auto losses = [&](const std::string& name) {
    std::vector<double> values;
    std::istringstream log(read_file(directory_ / (name + ".csv")));
    std::string line, cell;
    std::getline(log, line);
    while (std::getline(log, line)) {
      std::istringstream cells(line);
      for (int i = 0; i < 7; ++i) std::getline(cells, cell, ',');
      values.push_back(std::stod(cell));
    }
    return values;
  };
  const std::vector<double> alone = losses("one"), together = losses("two");
  ASSERT_EQ(alone.size(), together.size());
  for (std::size_t i = 0; i < alone.size(); ++i) EXPECT_NEAR(together[i], alone[i], 0.02) << i;
  expect_refusal(run_command("dofusion-train", arguments("three", "4", "2")), {"--rank"});
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
