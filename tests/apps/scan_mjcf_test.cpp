// dofusion-scan of a user's MuJoCo scene.
#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "perception/depth_io.h"
#include "stability/files.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using nlohmann::json;

// A shelf board at 0.4 m over the floor; a cube 10 cm above it; two equal cans and a ball on the floor; a camera that
// looks straight down and one along x. What is seen of the ball is a geom of group 1; group 3 is for contacts.
constexpr char kShelf[] = R"(<mujoco>
  <asset/>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <geom type="box" size="0.2 0.2 0.01" pos="0 0 0.39"/>
    <camera name="top" pos="0 0 2" fovy="60"/>
    <camera name="side" pos="2 0 0.3" xyaxes="0 1 0 0 0 1" fovy="45"/>
    <body name="cube" pos="0 0 0.55"><freejoint/><geom type="box" size="0.05 0.05 0.05"/></body>
    <body name="can" pos="0.4 0.4 0.06"><freejoint/><geom type="cylinder" size="0.03 0.06"/></body>
    <body name="other can" pos="-0.4 0.4 0.06"><freejoint/><geom type="cylinder" size="0.03 0.06"/></body>
    <body name="ball" pos="0.4 -0.4 0.04"><freejoint/>
      <geom type="sphere" size="0.04" group="1"/><geom type="box" size="0.02 0.02 0.02" group="3"/></body>
  </worldbody>
</mujoco>)";

class ScanMjcf : public testing::Test {
 protected:
  CommandResult scan(std::vector<std::string> more) const {
    std::vector<std::string> words{"--mjcf", file_, "--size", "320", "240", "--sensor", "none"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--out", directory_ / "out"});
    return run_command("dofusion-scan", words);
  }
  json read(const std::string& name) const { return json::parse(read_file(directory_ / ("out/" + name))); }
  double depth_mm(int image, int row, int column) const {
    Camera camera;
    camera.width = 320;
    camera.height = 240;
    camera.depth_scale = 0.1;
    camera.fx = camera.fy = 1.0;
    const DepthImage depth =
        read_depth(directory_ / ("out/test/000000/depth/00000" + std::to_string(image) + ".png"), camera);
    return 1000.0 * depth.at(row, column);
  }

  TemporaryDirectory directory_;
  std::string file_ = directory_ / "shelf.xml";
  void SetUp() override { write_file(file_, kShelf); }
};

TEST_F(ScanMjcf, BodiesAreModelsAndTheFilesCamerasLook) {
  expect_success(scan({"--camera", "all"}));
  const json info = read("models/models_info.json");
  ASSERT_EQ(info.size(), 3u);  // the cans are one model
  EXPECT_EQ(info["1"]["name"], "cube");
  EXPECT_NEAR(info["1"]["size_x"].get<double>(), 100.0, 1e-6);
  EXPECT_EQ(info["1"]["symmetries_discrete"].size(), 23u);
  EXPECT_EQ(info["2"]["symmetries_continuous"].size(), 1u);
  EXPECT_EQ(info["2"]["symmetries_discrete"].size(), 1u);
  EXPECT_EQ(info["3"]["symmetries_continuous"].size(), 3u);
  EXPECT_NEAR(info["3"]["size_z"].get<double>(), 80.0, 1e-6);

  const json truth = read("test/000000/scene_gt.json"), cameras = read("test/000000/scene_camera.json");
  ASSERT_EQ(truth.size(), 2u);
  ASSERT_EQ(truth["0"].size(), 4u);
  EXPECT_EQ(truth["0"][1]["obj_id"], truth["0"][2]["obj_id"]);
  // 60 and 45 degrees high.
  EXPECT_NEAR(cameras["0"]["cam_K"][4].get<double>(), 120.0 / std::tan(M_PI / 6.0), 1e-9);
  EXPECT_NEAR(cameras["1"]["cam_K"][4].get<double>(), 120.0 / std::tan(M_PI / 8.0), 1e-9);
  // The cube's centre is 1.45 m under the top camera and 0.25 m over the height of the other one.
  EXPECT_NEAR(truth["0"][0]["cam_t_m2c"][2].get<double>(), 1450.0, 1e-6);
  EXPECT_NEAR(truth["1"][0]["cam_t_m2c"][1].get<double>(), -250.0, 1e-6);
  EXPECT_NEAR(depth_mm(0, 120, 160), 1400.0, 0.1);  // the cube's top
  // 0.15 m aside at the board's depth of 1.6 m are 19.5 pixels: the shelf is there, but no object.
  EXPECT_NEAR(depth_mm(0, 120, 180), 1600.0, 0.1);
  EXPECT_NEAR(depth_mm(0, 5, 160), 2000.0, 0.1);  // the floor
}

TEST_F(ScanMjcf, SettlesFirstIfAsked) {
  expect_success(scan({"--settle", "--camera", "top"}));
  EXPECT_NEAR(read("test/000000/scene_gt.json")["0"][0]["cam_t_m2c"][2].get<double>(), 1550.0, 2.0);  // on the board
}

TEST_F(ScanMjcf, SampledViewpoints) {
  expect_success(scan({"--cameras", "3", "--distance", "2"}));
  EXPECT_EQ(read("test/000000/scene_gt.json").size(), 3u);
}

TEST_F(ScanMjcf, WhatCannotBeScannedIsRefused) {
  expect_refusal(scan({"--camera", "front"}), {"front", "top, side"});
  expect_refusal(scan({"--camera", "top", "--cameras", "2"}), {"--camera"});
  expect_refusal(scan({"--task", "stack"}), {"--mjcf"});
  write_file(file_, "<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>");
  expect_refusal(scan({}), {"shelf.xml", "moves"});
  write_file(file_, "<mujoco><worldbody><body><freejoint/><geom size=\"0.1\"/></body></worldbody></mujoco>");
  expect_refusal(scan({"--camera", "all"}), {"shelf.xml", "no camera"});
  std::string bodies;
  for (int k = 0; k < 254; ++k) {
    bodies += "<body pos=\"" + std::to_string(k) + " 0 0\"><freejoint/><geom size=\"0.1\"/></body>";
  }
  write_file(file_, "<mujoco><worldbody>" + bodies + "</worldbody></mujoco>");
  expect_refusal(scan({}), {"shelf.xml", "254 objects", "253"});
  // Inside the ball.
  write_file(file_,
             "<mujoco><worldbody><camera name=\"in\"/><body name=\"b\"><freejoint/><geom size=\"0.1\"/></body>"
             "</worldbody></mujoco>");
  expect_refusal(scan({"--camera", "in"}), {"scene 0", "image 0", "inside object 0 (b)"});
  EXPECT_EQ(entries(directory_.path()), std::vector<std::string>{"shelf.xml"});
}

}  // namespace
}  // namespace dofusion
