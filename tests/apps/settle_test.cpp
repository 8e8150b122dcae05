#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "stability/dataset.h"
#include "stability/files.h"
#include "stability/mjcf.h"
#include "stability/mjcf_scene.h"
#include "stability/physics.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using nlohmann::json;
using testing::HasSubstr;

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

class SettleTest : public testing::Test {
 protected:
  CommandResult settle(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--json", directory_ / "result.json"});
    return run_command("dofusion-settle", arguments);
  }
  json result() const { return json::parse(read_file(directory_ / "result.json")); }
  std::string written(const std::string& text) {
    write_file(directory_ / "scene.xml", text);
    return directory_ / "scene.xml";
  }
  // Two scenes: a stack of a cube and a hat, and a cube on a corner.
  std::string dataset() {
    SceneDataset data;
    data.shapes = {make_block("cube"), make_block("hat")};
    data.settings = R"({"parts": [{}]})";
    SceneRecord stack, falling;
    const double hat = 0.05 - bounding_box(data.shapes[1]->mesh).min.z();
    stack.objects = {{0, Eigen::Vector3d::Ones(), at(0, 0, 0.025), 3}, {1, Eigen::Vector3d::Ones(), at(0, 0, hat), 2}};
    falling.index = 1;
    falling.objects = {{0, Eigen::Vector3d::Ones(), make_pose(so3_exp({0.7, 0.3, 0}), {0, 0, 0.1}), 1}};
    data.scenes = {stack, falling};
    write_dataset(data, directory_ / "scenes.h5");
    return directory_ / "scenes.h5";
  }
  TemporaryDirectory directory_;
};

TEST_F(SettleTest, AStackFromADatasetStands) {
  const CommandResult run = settle({"--data", dataset(), "--query", "hat", "--out", directory_ / "settled"});
  expect_success(run);
  for (const char* word : {"cube", "hat", "surroundings", "stable: yes", "hat withstands a push of"}) {
    EXPECT_THAT(run.out, HasSubstr(word));
  }
  const json r = result();
  EXPECT_EQ(r.at("status"), "settled");
  EXPECT_TRUE(r.at("stable") && r.at("quiet") && !r.at("tilted"));
  EXPECT_EQ(r.at("bodies").at(0).at("touches"), (json{"surroundings", "hat"}));
  EXPECT_EQ(r.at("bodies").at(1).at("touches"), json{"cube"});
  // Slides on the cube at a friction of 0.8, or a little earlier: soft contacts give way.
  EXPECT_NEAR(r.at("query").at("largest_push_weights").get<double>(), 0.75, 0.05);
  EXPECT_TRUE(r.at("query").at("comes_off_upside_down"));
  EXPECT_EQ(entries(directory_ / "settled"), (std::vector<std::string>{"objects", "scene.xml"}));
  const Pose cube = MjcfScene(directory_ / "settled/scene.xml").initial_poses().at(1);
  EXPECT_NEAR(cube.translation().z(), r["bodies"][0]["T_world_body"][2][3].get<double>(), 1e-7);
}

TEST_F(SettleTest, AFallIsAResult) {
  const CommandResult run = settle({"--data", dataset(), "--scene", "1"});
  expect_success(run);
  EXPECT_THAT(run.out, HasSubstr("stable: no"));
  EXPECT_FALSE(result().at("stable"));
  EXPECT_GT(result().at("translational_displacement_pct"), 10.0);
}

TEST_F(SettleTest, AnMjcfFileWithAnArm) {
  const std::string path = written(
      "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body name='arm' pos='0 0 1'><joint axis='0 1 0' "
      "damping='1'/>"
      "<geom type='capsule' fromto='0 0 0 0.4 0 0' size='0.02'/></body>"
      "<body name='box' pos='1 0 0.1'><freejoint/><geom type='box' size='.1 .1 .1'/></body></worldbody></mujoco>");
  expect_success(settle({path, "--time-limit", "20"}));
  const json r = result();
  EXPECT_EQ(r.at("bodies").at(0).at("name"), "arm");
  EXPECT_NEAR(r["bodies"][0].at("rotational_displacement_deg").get<double>(), 90.0, 2.0);
  EXPECT_TRUE(r.at("tilted"));
  expect_refusal(settle({path, "--query", "box"}), {"'arm'", "joint"});
  expect_refusal(settle({path, "--out", directory_ / "x"}), {"'arm'", "joint"});
  EXPECT_FALSE(std::filesystem::exists(directory_ / "x"));
}

TEST_F(SettleTest, WhatWasWrittenIsSettledAgain) {
  expect_success(settle({"--data", dataset(), "--out", directory_ / "settled"}));
  expect_success(settle({directory_ / "settled/scene.xml", "--query", "object_1", "--out", directory_ / "again"}));
  EXPECT_TRUE(result().at("stable"));
  EXPECT_LT(result().at("translational_displacement_pct"),
            0.3);  // tests/stability/physics_test.cpp, ASettledSceneStays
  EXPECT_NEAR(result().at("query").at("largest_push_weights").get<double>(), 0.75, 0.05);
}

TEST_F(SettleTest, BadInputIsRefusedInOneLine) {
  const auto refused = [&](const std::vector<std::string>& arguments, const std::vector<std::string>& words) {
    expect_refusal(settle(arguments), words);
  };
  refused({}, {"--data"});
  refused({directory_ / "none.xml"}, {"none.xml", "no such"});
  refused({directory_.path()}, {"no such MJCF file"});
  refused({written("")}, {"scene.xml"});
  refused({written("<mujoco><worldbody>")}, {"scene.xml"});
  refused({written("<mujoco><include file='legs.xml'/></mujoco>")}, {"scene.xml", "legs.xml"});
  refused({written("<mujoco><asset><mesh file='cup.stl'/></asset></mujoco>")}, {"scene.xml", "cup.stl"});
  refused(
      {written("<mujoco><asset><mesh name='m' vertex='0 0 0 1 0 0 0 1 0 1 1 0' face='0 1 2 1 3 2'/></asset><worldbody>"
               "<geom type='mesh' mesh='m'/></worldbody></mujoco>")},
      {"scene.xml"});
  refused(
      {written("<mujoco><size nstack='10'/><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>")},
      {"scene.xml", "Stack overflow"});
  const std::string ball = written(
      "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body name='ball' pos='0 0 .1'><freejoint/><geom size='.1'/>"
      "</body></worldbody></mujoco>");
  refused({ball, "--query", "cup"}, {"--query", "cup", "ball"});
  refused({ball, "--keyframe", "home"}, {"scene.xml", "home"});
  refused({ball, "--time-limit", "0"}, {"--time-limit"});
  refused({ball, "--out", "/proc/x"}, {"/proc/x"});
  refused({ball, "--data", "x.h5"}, {"--data"});
  const std::string data = dataset();
  refused({"--data", data, "--scene", "2"}, {"scenes.h5", "no scene 2"});
  refused({"--data", data, "--scene", "-1"}, {"--scene"});
  refused({"--data", directory_ / "none.h5"}, {"none.h5"});
  refused({"--data", data, "--keyframe", "0"}, {"--keyframe"});
  EXPECT_FALSE(std::filesystem::exists(directory_ / "result.json"));
}

}  // namespace
}  // namespace dofusion
