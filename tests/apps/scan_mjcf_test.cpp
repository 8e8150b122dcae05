// dofusion-scan of a user's MuJoCo scene.
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "perception/depth_io.h"
#include "perception/geom_scanner.h"
#include "stability/files.h"
#include "stability/mjcf_scene.h"
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

// Half a metre of ball, whose tessellation would err by 0.5 mm, on a landscape; every pixel as GeomScanner sees it.
TEST_F(ScanMjcf, RoundShapesAndLandscapesAreExact) {
  std::string field;  // MuJoCo's own format: rows, columns, heights
  const std::int32_t sizes[2] = {2, 3};
  const float heights[6] = {0.0f, 0.5f, 1.0f, 0.2f, 0.1f, 0.9f};
  field.append(reinterpret_cast<const char*>(sizes), sizeof sizes);
  field.append(reinterpret_cast<const char*>(heights), sizeof heights);
  write_file(directory_ / "field.bin", field);
  write_file(file_, R"(<mujoco>
  <asset><hfield name="field" file="field.bin" size="2 2 0.3 0.1"/></asset>
  <worldbody>
    <geom type="hfield" hfield="field"/>
    <camera name="top" pos="0 0 3" fovy="40"/>
    <body name="ball" pos="0 0 1"><freejoint/><geom size="0.5" rgba="0.9 0.1 0.1 1"/></body>
    <body name="egg" pos="0.7 0 1"><freejoint/><geom type="ellipsoid" size="0.1 0.2 0.3"/></body>
    <body name="pill" pos="-0.7 0 1" euler="30 40 0"><freejoint/><geom type="capsule" size="0.1 0.2"/></body>
  </worldbody></mujoco>)");
  expect_success(scan({"--camera", "top"}));
  const MjcfScene scene(file_);
  GeomScanner scanner(scene.geoms());
  scanner.set_poses(scene.initial_poses());
  const Camera camera = camera_of_fovy(40.0 * M_PI / 180.0, 320, 240);
  const GeomScan truth = scanner.render(camera, camera_pose(scene.cameras()[0], scene.initial_poses()));
  Camera written = camera;
  written.depth_scale = 0.1;
  const DepthImage depth = read_depth(directory_ / "out/test/000000/depth/000000.png", written);
  const LabelImage ball = read_labels(directory_ / "out/test/000000/mask_visib/000000_000000.png", camera);
  int differ = 0;
  for (std::size_t i = 0; i < depth.pixels.size(); ++i) {
    differ += std::abs(depth.pixels[i] - truth.depth.pixels[i]) > 0.5e-4f + 1e-6f ? 1 : 0;  // half a step
    differ += (ball.pixels[i] != 0) != (truth.bodies.pixels[i] == 1) ? 1 : 0;
  }
  EXPECT_EQ(differ, 0);
  // The ball's outline is a circle of 0.5 m seen from 2 m: of radius f tan(asin(1/4)).
  const json info = read("test/000000/scene_gt_info.json")["0"][0];
  const double radius = camera.fy * std::tan(std::asin(0.25));
  EXPECT_NEAR(info["px_count_all"].get<double>(), M_PI * radius * radius, 3.0 * radius);  // a ring half a pixel wide
  EXPECT_NEAR(info["bbox_obj"][2].get<double>(), 2.0 * radius, 1.5);
}

// In the middle of the picture: red, as the file has it.
TEST_F(ScanMjcf, PicturesHaveTheFilesColours) {
  write_file(file_, R"(<mujoco><worldbody><camera name="top" pos="0 0 3"/>
    <body><freejoint/><geom size="0.5" rgba="0.9 0.1 0.1 1"/></body></worldbody></mujoco>)");
  for (const std::string more : {"--pcd", "--fine-rgb"}) {
    std::filesystem::remove_all(directory_ / "out");
    expect_success(scan({"--camera", "top", more}));
    const cv::Vec3b bgr = cv::imread(directory_ / "out/test/000000/rgb/000000.png").at<cv::Vec3b>(120, 160);
    EXPECT_GT(bgr[2], 150);
    EXPECT_LT(bgr[0], 80);
  }
}

// The same scene ten times as large, and small: the distance follows the objects' size, and so do the steps of depth.
TEST_F(ScanMjcf, TheDistanceFollowsTheObjectsSize) {
  for (const double size : {0.01, 1.0, 20.0}) {
    std::filesystem::remove_all(directory_ / "out");
    const std::string edge = std::to_string(size);
    write_file(file_, "<mujoco><worldbody><geom type='plane' size='0 0 1'/><body pos='0 0 " + edge +
                          "'><freejoint/><geom type='box' size='" + edge + " " + edge + " " + edge +
                          "'/></body></worldbody></mujoco>");
    expect_success(scan({"--cameras", "2", "--json", directory_ / "scan.json"}));
    // The ball around the cube fills three quarters of the image's height, of 2 atan(0.4).
    EXPECT_NEAR(json::parse(read_file(directory_ / "scan.json"))["distance"].get<double>(),
                std::sqrt(3.0) * size / std::sin(std::atan(0.3)), 1e-4 * size);
    const json info = read("test/000000/scene_gt_info.json");
    for (const auto& image : info) {
      EXPECT_EQ(image[0]["px_count_valid"], image[0]["px_count_all"]);  // whole, and near enough to be read
      EXPECT_GT(image[0]["px_count_all"].get<int>(), 320 * 240 / 10);
    }
  }
}

// Eight pendulums that swing for eight million steps, if nothing comes between.
TEST_F(ScanMjcf, CtrlCEndsSettling) {
  std::string bodies;
  for (int k = 0; k < 8; ++k) {
    bodies += "<body pos='0 " + std::to_string(k) + " 0'><joint axis='0 1 0'/><geom size='0.1' pos='1 0 0'/></body>";
  }
  write_file(file_, "<mujoco><option timestep='5e-7'/><worldbody>" + bodies + "</worldbody></mujoco>");
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"dofusion-scan", "--mjcf", file_, "--settle", "--out", directory_ / "out"},
        {"dofusion-settle", file_}}) {
    RunningCommand run(words);
    std::this_thread::sleep_for(std::chrono::seconds(2));
    ASSERT_FALSE(run.ended());
    run.send(SIGINT);
    const auto begin = std::chrono::steady_clock::now();
    const CommandResult result = run.wait();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));  // at once, on a busy machine
    EXPECT_EQ(result.status, 1) << result.err;
    EXPECT_NE(result.err.find("interrupted"), std::string::npos) << result.err;
  }
  EXPECT_EQ(entries(directory_.path()), std::vector<std::string>{"shelf.xml"});
}

TEST_F(ScanMjcf, WhatCannotBeScannedIsRefused) {
  expect_refusal(scan({"--camera", "front"}), {"front", "top, side"});
  expect_refusal(scan({"--camera", "top", "front"}), {"front", "top, side"});
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
  write_file(file_,
             "<mujoco><worldbody><geom type=\"plane\" size=\"0 0 1\"/><camera name=\"under\" pos=\"0 0 -1\"/>"
             "<body name=\"b\" pos=\"0 0 0.1\"><freejoint/><geom size=\"0.1\"/></body></worldbody></mujoco>");
  expect_refusal(scan({"--camera", "under"}), {"scene 0", "image 0", "behind a plane"});
  // Inside what does not move.
  write_file(file_,
             "<mujoco><worldbody><geom type=\"box\" size=\"1 1 1\"/><camera name=\"in\"/><body pos=\"0 0 2\">"
             "<freejoint/><geom size=\"0.1\"/></body></worldbody></mujoco>");
  expect_refusal(scan({"--camera", "in"}), {"image 0 (in)", "inside 'world'"});
  // On the surface, as the humanoid's own eyes.
  write_file(file_,
             "<mujoco><worldbody><body><freejoint/><geom size=\"0.1\"/><camera name=\"eye\" pos=\"0.1 0 0\"/></body>"
             "</worldbody></mujoco>");
  expect_refusal(scan({"--camera", "eye"}), {"image 0 (eye)", "inside object 0", "--camera"});
  EXPECT_EQ(entries(directory_.path()), std::vector<std::string>{"shelf.xml"});
}

}  // namespace
}  // namespace dofusion
