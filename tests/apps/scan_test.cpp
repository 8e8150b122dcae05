// dofusion-scan as a user meets it.
#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "perception/depth_io.h"
#include "stability/dataset.h"
#include "stability/files.h"
#include "stability/pose.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;

std::vector<std::string> files_below(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) names.push_back(fs::relative(entry.path(), folder).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

TEST(Scan, WritesABopDatasetThatTheSeedRepeats) {
  const TemporaryDirectory directory;
  const std::vector<std::string> common = {"--task", "stack",  "--objects", "2",   "--count", "2", "--cameras",
                                           "2",      "--size", "160",       "120", "--seed",  "4"};
  for (const auto& [out, threads] : {std::pair<const char*, const char*>{"a", "1"}, {"b", "2"}}) {
    std::vector<std::string> arguments = common;
    for (const std::string& word : {std::string("--threads"), std::string(threads), std::string("--json"),
                                    directory / (std::string(out) + ".json"), std::string("--out"), directory / out}) {
      arguments.push_back(word);
    }
    expect_success(run_command("dofusion-scan", arguments));
  }
  const std::vector<std::string> files = files_below(directory / "a");
  EXPECT_EQ(files, files_below(directory / "b"));
  for (const std::string& name : files) {
    EXPECT_TRUE(read_file(directory / ("a/" + name)) == read_file(directory / ("b/" + name))) << name;
  }
  const json result = json::parse(read_file(directory / "a.json"));
  EXPECT_EQ(result.at("scenes"), 2);
  EXPECT_EQ(result.at("images"), 4);
  const Camera camera = read_camera(directory / "a/camera.json");
  EXPECT_EQ(camera.width, 160);
  const DepthImage depth = read_depth(directory / "a/test/000001/depth/000001.png", camera);
  int readings = 0;
  for (const float z : depth.pixels) readings += z > 0.3F && z < 2.0F ? 1 : 0;
  EXPECT_GT(readings, 160 * 120 / 2);  // a table 0.7 m away
}

TEST(Scan, TakesASplitOfADataset) {
  const TemporaryDirectory directory;
  write_file(directory / "recipe.json", R"({"test": 0.4, "parts": [{"task": "single", "count": 8}]})");
  expect_success(
      run_command("dofusion-generate", {"--recipe", directory / "recipe.json", "--out", directory / "d.h5"}));
  DatasetFilter filter;
  filter.split = Split::kTest;
  const std::size_t scenes = read_dataset(directory / "d.h5", filter).scenes.size();
  ASSERT_GT(scenes, 0u);
  ASSERT_LT(scenes, 8u);
  expect_success(run_command("dofusion-scan", {"--data", directory / "d.h5", "--data-split", "test", "--size", "160",
                                               "120", "--json", directory / "s.json", "--out", directory / "scans"}));
  EXPECT_EQ(json::parse(read_file(directory / "s.json")).at("scenes"), scenes);
}

// The image, and where the objects are before the camera that took it, stay; what is said of the camera's pose is
// wrong.
TEST(Scan, AMiscalibratedCameraIsElsewhereThanItsFileSays) {
  const TemporaryDirectory directory;
  const auto scan = [&](const std::string& out, std::vector<std::string> more) {
    more.insert(more.end(), {"--task", "single", "--count", "2", "--cameras", "3", "--size", "160", "120", "--seed",
                             "11", "--noise-scale", "2", "--out", directory / out});
    expect_success(run_command("dofusion-scan", more));
  };
  scan("exact", {});
  scan("off", {"--pose-error", "0.5", "3"});
  for (const std::string& name : files_below(directory / "exact")) {
    const bool same = read_file(directory / ("exact/" + name)) == read_file(directory / ("off/" + name));
    EXPECT_EQ(same, name.find("scene_camera.json") == std::string::npos) << name;
  }
  const auto pose_in = [](const json& camera) {  // T_world_camera, millimetres
    Pose pose = Pose::Identity();
    for (int k = 0; k < 9; ++k) pose.matrix()(k / 3, k % 3) = camera.at("cam_R_w2c").at(k).get<double>();
    for (int k = 0; k < 3; ++k) pose.matrix()(k, 3) = camera.at("cam_t_w2c").at(k).get<double>();
    return pose.inverse();
  };
  for (const std::string scene : {"000000", "000001"}) {
    const std::string file = "/test/" + scene + "/scene_camera.json";
    const json exact = json::parse(read_file(directory / ("exact" + file)));
    const json off = json::parse(read_file(directory / ("off" + file)));
    for (const auto& [image, camera] : exact.items()) {
      EXPECT_EQ(off.at(image).at("cam_K"), camera.at("cam_K"));
      const Pose truth = pose_in(camera), believed = pose_in(off.at(image));
      // Twice half a degree and 3 mm: five standard deviations of each of three components.
      const Eigen::Vector3d turn = so3_log(truth.linear().transpose() * believed.linear()) * 180.0 / M_PI;
      const Eigen::Vector3d shift = believed.translation() - truth.translation();
      EXPECT_LT(turn.cwiseAbs().maxCoeff(), 5.0);
      EXPECT_LT(shift.cwiseAbs().maxCoeff(), 30.0);
      EXPECT_GT(turn.norm(), 0.01);
      EXPECT_GT(shift.norm(), 0.06);
    }
  }
}

TEST(Scan, BadInputIsRefusedAndLeavesNothing) {
  const TemporaryDirectory directory;
  const auto scan = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--out", directory / "out"});
    return run_command("dofusion-scan", arguments);
  };
  expect_refusal(scan({"--sensor", "lidar"}), {"lidar", "realsense"});
  expect_refusal(scan({"--task", "heap"}), {"heap"});
  expect_refusal(scan({"--split", "a/b"}), {"--split"});
  expect_refusal(scan({"--objects", "9"}), {"9"});
  expect_refusal(scan({"--pose-error", "1"}), {"--pose-error"});
  expect_refusal(scan({"--pose-error", "-1", "0"}), {"--pose-error"});
  expect_refusal(scan({"--data", directory / "none.h5"}), {"none.h5", "no such"});
  write_file(directory / "bad.h5", "no HDF5 at all");
  expect_refusal(scan({"--data", directory / "bad.h5"}), {"bad.h5"});
  expect_refusal(scan({"--data", directory / "bad.h5", "--data-split", "exam"}), {"exam", "validation"});
  expect_refusal(run_command("dofusion-scan", {"--count", "1", "--out", "/proc/x"}), {"/proc/x"});
  EXPECT_EQ(entries(directory.path()), std::vector<std::string>{"bad.h5"});
}

}  // namespace
}  // namespace dofusion
