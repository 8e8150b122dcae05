// dofusion-generate as a user meets it.
#include <gtest/gtest.h>

#include "stability/dataset.h"
#include "stability/files.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

CommandResult generate(std::vector<std::string> arguments, const std::string& out) {
  for (const char* word : {"--count", "6", "--objects", "2", "--out"}) arguments.emplace_back(word);
  arguments.push_back(out);
  return run_command("dofusion-generate", arguments);
}

TEST(Generate, SameSeedGivesTheSameScenesOnAnyNumberOfThreads) {
  const TemporaryDirectory directory;
  expect_success(generate({"--seed", "3", "--threads", "1"}, directory / "a.h5"));
  expect_success(generate({"--seed", "3", "--threads", "3"}, directory / "b.h5"));
  EXPECT_EQ(entries(directory.path()), (std::vector<std::string>{"a.h5", "b.h5"}));  // no file.partial
  EXPECT_TRUE(read_file(directory / "a.h5") == read_file(directory / "b.h5"));
  const SceneDataset dataset = read_dataset(directory / "a.h5");
  ASSERT_EQ(dataset.scenes.size(), 6u);
  for (const SceneRecord& scene : dataset.scenes) {
    EXPECT_EQ(scene.task, Task::kUnstructured);
    EXPECT_EQ(scene.objects.size(), 2u);
  }
}

TEST(Generate, GoesOnWithWhatAKilledRunLeft) {
  const TemporaryDirectory directory;
  expect_success(generate({}, directory / "whole.h5"));
  SceneDataset part = read_dataset(directory / "whole.h5");
  part.scenes.resize(2);
  write_dataset(part, directory / "again.h5.partial");
  expect_success(generate({}, directory / "again.h5"));
  const SceneDataset again = read_dataset(directory / "again.h5"), whole = read_dataset(directory / "whole.h5");
  ASSERT_EQ(again.scenes.size(), whole.scenes.size());
  for (std::size_t i = 0; i < whole.scenes.size(); ++i) {
    ASSERT_EQ(again.scenes[i].objects.size(), whole.scenes[i].objects.size());
    for (std::size_t k = 0; k < whole.scenes[i].objects.size(); ++k) {  // quaternions are rounded once more on the way
      EXPECT_TRUE(again.scenes[i].objects[k].T_world_object.isApprox(whole.scenes[i].objects[k].T_world_object, 1e-12));
    }
  }
  write_dataset(part, directory / "other.h5.partial");
  expect_refusal(generate({"--seed", "9"}, directory / "other.h5"), {"other.h5.partial", "other settings"});
}

TEST(Generate, BadArgumentsAreRefused) {
  const TemporaryDirectory directory;
  const std::string out = directory / "x.h5";
  expect_refusal(generate({"--task", "heap"}, out), {"heap", "unstructured"});
  expect_refusal(generate({"--shapes", "cones"}, out), {"cones", "blocks"});
  for (const char* objects : {"0", "7", "-1"}) {
    expect_refusal(run_command("dofusion-generate", {"--objects", objects, "--out", out}), {objects});
  }
  expect_refusal(run_command("dofusion-generate", {"--count", "0", "--out", out}), {"--count"});
  expect_refusal(generate({"--seed", "-1"}, out), {"--seed"});
  expect_refusal(generate({}, directory / "none/x.h5"), {"none/x.h5", "cannot be written"});
  expect_refusal(generate({}, "/proc/x.h5"), {"/proc/x.h5", "cannot be written"});
  expect_refusal(run_command("dofusion-generate", {}), {"--out"});
  EXPECT_TRUE(entries(directory.path()).empty());
}

}  // namespace
}  // namespace dofusion
