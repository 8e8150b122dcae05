// dofusion-generate as a user meets it.
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <thread>
#include <tuple>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "stability/dataset.h"
#include "stability/files.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using nlohmann::json;
using testing::HasSubstr;

// Three kinds of scenes, 240 in all.
constexpr const char* kRecipe = R"({"validation": 0.1, "test": 0.1, "parts": [{"task": "single", "count": 200},
  {"task": "unstructured", "objects": 2, "count": 30}, {"task": "stack", "objects": 2, "shapes": "general", "count": 10}]})";

std::uintmax_t size_of(const std::string& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  return error ? 0 : size;
}

class GenerateTest : public testing::Test {
 protected:
  void SetUp() override { write_file(recipe_, kRecipe); }

  std::vector<std::string> words(const std::string& out, const std::string& threads = "2") const {
    return {"dofusion-generate", "--recipe", recipe_, "--seed", "3", "--threads", threads, "--out", directory_ / out};
  }
  CommandResult generate(const std::string& out, const std::string& threads = "2") const {
    return RunningCommand(words(out, threads)).wait();
  }
  std::string journal(const std::string& out) const { return directory_ / (out + ".partial"); }

  // Waits until the journal of a running job has grown by some fifteen scenes; false if the job ends before.
  bool wait_for_scenes(RunningCommand& command, const std::string& out) const {
    const std::uintmax_t begin = size_of(journal(out));
    while (size_of(journal(out)) < begin + 3000) {
      if (command.ended()) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
  }
  // Ends a run after some scenes. One that is through before that, on a busy machine, is tried again.
  CommandResult end_midway(const std::vector<std::string>& command, const std::string& out,
                           const std::function<void(RunningCommand&)>& end) const {
    CommandResult result;
    for (int attempt = 0; attempt < 10; ++attempt) {
      RunningCommand run(command);
      if (wait_for_scenes(run, out)) end(run);
      result = run.wait();
      if (result.status != 0) return result;
      std::filesystem::remove(directory_ / out);
    }
    ADD_FAILURE() << "the run is always done before it can be ended";
    return result;
  }
  static std::function<void(RunningCommand&)> with_signal(int number) {
    return [number](RunningCommand& run) { run.send(number); };
  }
  // What an uninterrupted run on one thread gives.
  std::string plain_bytes() const {
    expect_success(generate("plain.h5", "1"));
    return read_file(directory_ / "plain.h5");
  }

  TemporaryDirectory directory_;
  std::string recipe_ = directory_ / "recipe.json";
};

TEST_F(GenerateTest, SameSeedGivesTheSameBytesOnAnyNumberOfThreads) {
  const std::string one = plain_bytes();
  expect_success(generate("three.h5", "3"));
  EXPECT_TRUE(one == read_file(directory_ / "three.h5"));
  EXPECT_EQ(entries(directory_.path()), (std::vector<std::string>{"plain.h5", "recipe.json", "three.h5"}));
}

TEST_F(GenerateTest, RecipeGivesItsPartsAndSaysWhatItDid) {
  auto arguments = words("parts.h5");
  arguments.insert(arguments.end(), {"--scale", "0.1", "--json", directory_ / "done.json"});
  expect_success(RunningCommand(arguments).wait());
  const SceneDataset dataset = read_dataset(directory_ / "parts.h5");
  ASSERT_EQ(dataset.scenes.size(), 24u);
  std::size_t i = 0;
  std::array<int, 3> splits{};
  for (const auto& [part, task, count] :
       {std::tuple{0, Task::kSingle, 20}, {1, Task::kUnstructured, 3}, {2, Task::kStack, 1}}) {
    for (int index = 0; index < count; ++index, ++i) {
      const SceneRecord& scene = dataset.scenes[i];
      EXPECT_EQ(scene.part, part);
      EXPECT_EQ(scene.index, index);
      EXPECT_EQ(scene.task, task);
      EXPECT_EQ(scene.objects.size(), task == Task::kSingle ? 1u : 2u);
      EXPECT_EQ(scene.split, split_of(3, part, index, {0.1, 0.1}));
      ++splits[static_cast<std::size_t>(scene.split)];
    }
  }
  const json settings = json::parse(dataset.settings), done = json::parse(read_file(directory_ / "done.json"));
  EXPECT_EQ(settings.at("seed"), 3);
  EXPECT_EQ(settings.at("parts").at(2).at("shapes"), "general");
  EXPECT_EQ(done.at("scenes"), 24);
  EXPECT_EQ(done.at("splits"), (json{{"train", splits[0]}, {"validation", splits[1]}, {"test", splits[2]}}));
  EXPECT_EQ(done.at("parts").at(1).at("scenes"), 3);
  EXPECT_GE(done.at("drops"), 27);  // one an object at least
  EXPECT_GE(done.at("seconds"), 0.0);
}

TEST_F(GenerateTest, KilledTwiceAndResumedGivesTheSameBytes) {
  const std::string whole = plain_bytes();
  for (const char* threads : {"2", "1"}) {
    EXPECT_EQ(end_midway(words("killed.h5", threads), "killed.h5", with_signal(SIGKILL)).status, -SIGKILL);
    EXPECT_EQ(size_of(directory_ / "killed.h5"), 0u);
    EXPECT_GE(size_of(journal("killed.h5")), 3000u);
  }
  const CommandResult resumed = generate("killed.h5", "3");
  expect_success(resumed);
  EXPECT_THAT(resumed.err, HasSubstr("continuing with the"));
  EXPECT_TRUE(whole == read_file(directory_ / "killed.h5"));
  EXPECT_EQ(size_of(journal("killed.h5")), 0u);
}

TEST_F(GenerateTest, DamagedJournalGivesTheSameBytes) {
  const std::string whole = plain_bytes();
  end_midway(words("damaged.h5"), "damaged.h5", with_signal(SIGKILL));
  std::string bytes = read_file(journal("damaged.h5"));
  bytes[bytes.size() - 2000] = static_cast<char>(bytes[bytes.size() - 2000] ^ 1);
  write_file(journal("damaged.h5"), bytes.substr(0, bytes.size() - 10));
  expect_success(generate("damaged.h5"));
  EXPECT_TRUE(whole == read_file(directory_ / "damaged.h5"));
}

TEST_F(GenerateTest, InterruptLeavesTheJournalAndTheOldFile) {
  const CommandResult result = end_midway(words("old.h5"), "old.h5", [&](RunningCommand& run) {
    write_file(directory_ / "old.h5", "what was there");
    run.send(SIGINT);
  });
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("interrupted; the same command goes on from"));
  EXPECT_EQ(read_file(directory_ / "old.h5"), "what was there");
  EXPECT_GT(size_of(journal("old.h5")), 3000u);
}

TEST_F(GenerateTest, TwoRunsOnOneFileAreRefused) {
  end_midway(words("twice.h5"), "twice.h5", [&](RunningCommand& run) {
    run.send(SIGSTOP);  // it keeps what it has open
    if (!run.ended()) expect_refusal(generate("twice.h5"), {"twice.h5.partial", "another run"});
    run.send(SIGKILL);
  });
}

TEST_F(GenerateTest, FullDiskKeepsTheOldFileAndTheJournal) {
  write_file(directory_ / "full.h5", "what was there");
  const auto run_with = [&](std::int64_t most) {
    CommandOptions options;
    options.most_file_bytes = most;
    return RunningCommand(words("full.h5"), options).wait();
  };
  const CommandResult short_journal = run_with(9000);
  EXPECT_EQ(short_journal.status, 2);
  EXPECT_THAT(short_journal.err, HasSubstr("full.h5.partial: cannot be written"));
  EXPECT_EQ(read_file(directory_ / "full.h5"), "what was there");
  EXPECT_GT(size_of(journal("full.h5")), 3000u);
  EXPECT_LE(size_of(journal("full.h5")), 9000u);
  expect_success(generate("full.h5"));
  EXPECT_TRUE(plain_bytes() == read_file(directory_ / "full.h5"));
}

TEST_F(GenerateTest, BadArgumentsAreRefused) {
  const std::string out = directory_ / "x.h5";
  const auto refused = [&](std::vector<std::string> arguments, const std::vector<std::string>& named) {
    if (std::count(arguments.begin(), arguments.end(), "--out") == 0) arguments.insert(arguments.end(), {"--out", out});
    expect_refusal(run_command("dofusion-generate", arguments), named);
  };
  refused({"--task", "heap"}, {"heap", "unstructured"});
  refused({"--shapes", "cones"}, {"cones", "blocks"});
  for (const char* objects : {"0", "7", "-1"}) refused({"--objects", objects}, {objects});
  refused({"--count", "0"}, {"--count"});
  refused({"--seed", "-1"}, {"--seed"});
  refused({"--recipe", directory_ / "none.json"}, {"none.json", "no such file"});
  refused({"--recipe", recipe_, "--count", "3"}, {"--count", "--recipe"});
  refused({"--scale", "2"}, {"--scale", "--recipe"});
  refused({"--out", directory_ / "none/x.h5"}, {"none/x.h5", "cannot be written"});
  refused({"--out", "/proc/x.h5"}, {"/proc/x.h5", "cannot be written"});
  refused({"--out", "/dev/full"}, {"/dev/full", "is not a file"});
  refused({"--out", directory_.path()}, {"is not a file"});
  refused({"--json", directory_ / "none/x.json"}, {"none/x.json"});
  expect_refusal(run_command("dofusion-generate", {}), {"--out"});
  write_file(directory_ / "bad.json", R"({"parts": [{"task": "stack", "objects": 9, "count": 1}]})");
  refused({"--recipe", directory_ / "bad.json"}, {"bad.json", "part 0", "objects"});
  write_file(out + ".partial", "my notes");
  refused({"--count", "3"}, {"x.h5.partial", "not the journal"});
  EXPECT_EQ(entries(directory_.path()), (std::vector<std::string>{"bad.json", "recipe.json", "x.h5.partial"}));
}

#ifdef DOFUSION_MPIRUN

class GenerateOnRanksTest : public GenerateTest {
 protected:
  // Kills the ranks, by the one name that only they have in their arguments; mpirun ends with them.
  void kill_ranks(const std::string& out) const {
    for (const auto& process : std::filesystem::directory_iterator("/proc")) {
      const std::string name = process.path().filename().string();
      if (name.find_first_not_of("0123456789") != std::string::npos) continue;
      std::string command;
      try {
        command = read_file(process.path() / "cmdline");
      } catch (const InputError&) {
        continue;  // ended meanwhile
      }
      const bool is_rank = command.rfind(std::string(DOFUSION_BIN_DIR) + "/dofusion-generate", 0) == 0;
      if (is_rank && command.find(directory_ / out) != std::string::npos) ::kill(std::stoi(name), SIGKILL);
    }
  }
};

TEST_F(GenerateOnRanksTest, TwoGiveTheSameBytesAsOne) {
  auto arguments = words("ranks.h5", "1");
  arguments.insert(arguments.end(), {"--json", directory_ / "done.json"});
  expect_success(RunningCommand(on_two_ranks(arguments)).wait());
  EXPECT_EQ(json::parse(read_file(directory_ / "done.json")).at("ranks"), 2);
  EXPECT_TRUE(plain_bytes() == read_file(directory_ / "ranks.h5"));
}

TEST_F(GenerateOnRanksTest, KilledAndResumedOnOneGivesTheSameBytes) {
  end_midway(on_two_ranks(words("ranks.h5", "1")), "ranks.h5", [&](RunningCommand&) { kill_ranks("ranks.h5"); });
  EXPECT_EQ(size_of(directory_ / "ranks.h5"), 0u);
  EXPECT_GT(size_of(journal("ranks.h5")), 3000u);
  expect_success(generate("ranks.h5"));
  EXPECT_TRUE(plain_bytes() == read_file(directory_ / "ranks.h5"));
}

TEST_F(GenerateOnRanksTest, ErrorsAreOneLineAndTheRightStatus) {
  const auto refused = [&](const std::vector<std::string>& command, const std::string& named) {
    const CommandResult result = RunningCommand(on_two_ranks(command)).wait();
    EXPECT_EQ(result.status, 2) << result.err;
    const auto first = result.err.find("dofusion-generate: ");  // mpirun adds lines of its own
    ASSERT_NE(first, std::string::npos) << result.err;
    EXPECT_EQ(result.err.find("dofusion-generate: ", first + 1), std::string::npos) << result.err;
    EXPECT_THAT(result.err, HasSubstr(named));
  };
  refused({"dofusion-generate", "--task", "heap", "--out", directory_ / "x.h5"}, "unknown task 'heap'");
  refused({"dofusion-generate", "--colour", "red", "--out", directory_ / "x.h5"}, "--colour");
  // The second rank is given another plan.
  std::vector<std::string> both = words("y.h5");
  both.insert(both.end(), {":", "-n", "1", std::string(DOFUSION_BIN_DIR) + "/dofusion-generate", "--count", "3",
                           "--out", directory_ / "y.h5"});
  refused(both, "has another plan than the first rank");
}

#else

TEST(GenerateOnRanksTest, TwoGiveTheSameBytesAsOne) { GTEST_SKIP() << "built without MPI, or there is no mpirun"; }

#endif

}  // namespace
}  // namespace dofusion
