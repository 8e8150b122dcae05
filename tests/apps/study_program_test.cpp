// dofusion-study as a user runs it.
#include <filesystem>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "stability/files.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

// The rows of trials.csv without the two columns of times, which come last.
std::string trials_of(const std::string& folder) {
  std::istringstream lines(read_file(folder + "/trials.csv"));
  std::string all;
  for (std::string line; std::getline(lines, line);) {
    for (int k = 0; k < 2; ++k) line.erase(line.rfind(','));
    all += line + "\n";
  }
  return all;
}

class StudyProgramTest : public testing::Test {
 protected:
  void SetUp() override {
    write_file(directory_ / "study.json", R"({"noise_scales": [1], "samples": 2, "steps": 10,
                                              "tasks": [{"task": "single", "objects": 1}],
                                              "series": [{"known": false}]})");
  }
  std::vector<std::string> words(const std::string& out) const {
    return {"dofusion-study", "--config", directory_ / "study.json", "--trials",       "4",
            "--seed",         "9",        "--threads",               "1", "--out", directory_ / out};
  }
  TemporaryDirectory directory_;
};

TEST_F(StudyProgramTest, LeavesItsFilesAndNothingElse) {
  auto command = words("plain");
  command.insert(command.end(), {"--json", directory_ / "summary.json"});
  expect_success(RunningCommand(command).wait());
  EXPECT_EQ(entries(directory_ / "plain"), (std::vector<std::string>{"displacement.svg", "report.html", "series.svg",
                                                                     "success.svg", "summary.json", "trials.csv", "worst.html"}));
  EXPECT_EQ(entries(directory_.path()), (std::vector<std::string>{"plain", "study.json", "summary.json"}));
  const auto summary = nlohmann::json::parse(read_file(directory_ / "summary.json"));
  EXPECT_EQ(summary, nlohmann::json::parse(read_file(directory_ / "plain/summary.json")));
  EXPECT_EQ(summary["series"].size(), 2u);
  EXPECT_EQ(summary["models_fnv1a"].size(), 2u);

  if (on_two_ranks(words("ranks")).empty()) GTEST_SKIP() << "built without MPI, or there is no mpirun";
  expect_success(RunningCommand(on_two_ranks(words("ranks"))).wait());
  EXPECT_EQ(trials_of(directory_ / "ranks"), trials_of(directory_ / "plain"));
}

TEST_F(StudyProgramTest, BadArgumentsAreRefused) {
  const auto refused = [&](std::vector<std::string> arguments, const std::vector<std::string>& named) {
    expect_refusal(run_command("dofusion-study", arguments), named);
  };
  const std::string out = directory_ / "out";
  refused({"--trials", "0", "--out", out}, {"--trials"});
  refused({"--config", directory_ / "none.json", "--out", out}, {"none.json", "no such file"});
  refused({"--model", directory_ / "none.safetensors", "--out", out}, {"none.safetensors"});
  refused({"--json", directory_ / "none/x.json", "--trials", "1", "--out", out}, {"none/x.json"});
  EXPECT_EQ(entries(directory_.path()), (std::vector<std::string>{"study.json"}));
}

}  // namespace
}  // namespace dofusion
