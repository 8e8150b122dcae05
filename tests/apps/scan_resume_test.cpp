// dofusion-scan after kills and Ctrl-C, and scenes that cannot be scanned.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <map>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "stability/dataset.h"
#include "stability/files.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

std::map<std::string, std::string> bytes_below(const fs::path& folder) {
  std::map<std::string, std::string> bytes;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) bytes[fs::relative(entry.path(), folder).string()] = read_file(entry.path());
  }
  return bytes;
}

// Depth images so far.
int images_below(const fs::path& folder) {
  int images = 0;
  std::error_code error;  // folders are renamed meanwhile
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    images += entry->path().parent_path().filename() == "depth" ? 1 : 0;
  }
  return images;
}

class ScanResume : public testing::Test {
 protected:
  // 60 images of 12 scenes.
  Words words(const std::string& out, const std::string& threads) const {
    return {"dofusion-scan", "--task", "single", "--count", "12",        "--cameras", "5",     "--size",
            "320",           "240",    "--seed", "9",       "--threads", threads,     "--out", directory_ / out};
  }
  std::string partial(const std::string& out) const { return directory_ / (out + ".partial"); }

  // Sends a signal after some more images; false if the run was done before.
  bool end_after_images(const std::string& out, const std::string& threads, int signal, int images) {
    RunningCommand run(words(out, threads));
    const int begin = images_below(partial(out));
    while (images_below(partial(out)) < begin + images && !run.ended()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    if (!run.ended()) run.send(signal);
    ended_ = run.wait();
    return ended_.status != 0;
  }
  std::map<std::string, std::string> plain() const {
    expect_success(RunningCommand(words("plain", "1")).wait());
    return bytes_below(directory_ / "plain");
  }

  TemporaryDirectory directory_;
  CommandResult ended_;
};

TEST_F(ScanResume, KillsLoseNothingAndChangeNoByte) {
  const std::map<std::string, std::string> wanted = plain();
  ASSERT_GT(wanted.size(), 60u * 4);
  for (const std::string threads : {"1", "3"}) {
    int kills = 0;
    while (kills < 4 && end_after_images(threads, threads, SIGKILL, 8)) {
      ++kills;
      EXPECT_FALSE(fs::exists(directory_ / threads)) << "half a dataset under the final name";
      const auto before = fs::last_write_time(partial(threads) + "/models/models_info.json");
      EXPECT_LE(before, fs::file_time_type::clock::now());
    }
    EXPECT_GT(kills, 0);
    if (!fs::exists(directory_ / threads)) {
      const CommandResult last = RunningCommand(words(threads, threads)).wait();
      expect_success(last);
      EXPECT_NE(last.err.find("continuing with the "), std::string::npos) << last.err;
    }
    EXPECT_FALSE(fs::exists(partial(threads)));
    const std::map<std::string, std::string> found = bytes_below(directory_ / threads);
    EXPECT_EQ(found.size(), wanted.size());
    EXPECT_TRUE(found == wanted) << threads;
  }
}

TEST_F(ScanResume, CtrlCLeavesWhatTheNextRunGoesOnWith) {
  ASSERT_TRUE(end_after_images("out", "2", SIGINT, 3));
  EXPECT_EQ(ended_.status, 1);
  EXPECT_NE(ended_.err.find("the same command goes on"), std::string::npos) << ended_.err;
  EXPECT_GT(images_below(partial("out")), 0);
  expect_success(RunningCommand(words("out", "1")).wait());
  EXPECT_TRUE(bytes_below(directory_ / "out") == plain());
}

TEST_F(ScanResume, OtherSettingsAreRefusedAndNameBoth) {
  ASSERT_TRUE(end_after_images("out", "2", SIGKILL, 3));
  Words other = words("out", "1");
  *(std::find(other.begin(), other.end(), "--seed") + 1) = "10";
  expect_refusal(RunningCommand(other).wait(), {"out.partial", "seed 9", "10"});
  expect_success(RunningCommand(words("out", "1")).wait());
  expect_refusal(RunningCommand(words("out", "1")).wait(), {"out", "already"});
}

// What a kill leaves half written has a temporary name, which the next run removes; a folder that no scan left stays.
TEST_F(ScanResume, ForeignFoldersAreLeftAlone) {
  fs::create_directories(partial("out"));
  write_file(partial("out") + "/mine.txt", "mine");
  expect_refusal(RunningCommand(words("out", "1")).wait(), {"out.partial", "no scan left it"});
  EXPECT_EQ(read_file(partial("out") + "/mine.txt"), "mine");
}

// Datasets of scenes that no camera can show.
class UnusableScenes : public testing::Test {
 protected:
  void write_scenes(const std::vector<std::vector<Pose>>& scenes) const {
    SceneDataset dataset;
    dataset.settings = "{}";
    dataset.shapes = {make_block("cube")};
    for (std::size_t k = 0; k < scenes.size(); ++k) {
      SceneRecord record;
      record.index = static_cast<std::int64_t>(k);
      for (const Pose& pose : scenes[k]) {
        SceneObject object;
        object.T_world_object = pose;
        record.objects.push_back(object);
      }
      dataset.scenes.push_back(record);
    }
    write_dataset(dataset, directory_ / "scenes.h5");
  }
  void expect_scan_refusal(const Words& more, const Words& words) const {
    Words arguments{"--data", directory_ / "scenes.h5", "--size", "64", "48", "--out", directory_ / "out"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_refusal(run_command("dofusion-scan", arguments), words);
    EXPECT_EQ(entries(directory_.path()), Words{"scenes.h5"});
  }
  static Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

  const Pose on_table_ = at(0, 0, 0.025);
  TemporaryDirectory directory_;
};

// The camera looks at the middle between two cubes six metres apart.
TEST_F(UnusableScenes, ObjectsOutsideEveryImage) {
  write_scenes({{on_table_}, {at(-3, 0, 0.025), at(3, 0, 0.025)}});
  expect_scan_refusal({}, {"scene 1", "object 0 (cube)", "outside"});
}

// 27 cubes without a gap around the point that the camera looks at, 8 cm away.
TEST_F(UnusableScenes, CameraInsideAnObject) {
  std::vector<Pose> heap;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = 0; z < 3; ++z) heap.push_back(at(0.05 * x, 0.05 * y, 0.025 + 0.05 * z));
    }
  }
  write_scenes({{on_table_}, heap});
  expect_scan_refusal({"--distance", "0.08"}, {"scene 1", "camera is inside object"});
}

// The camera is at most 0.7 m above a cube that lies a metre below the table.
TEST_F(UnusableScenes, CameraUnderTheTable) {
  write_scenes({{on_table_}, {on_table_}, {at(0, 0, -1.0)}});
  expect_scan_refusal({}, {"scene 2", "image 0", "under the table"});
}

}  // namespace
}  // namespace dofusion
