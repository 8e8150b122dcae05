#include "stability/mjcf_scene.h"

#include <cmath>
#include <filesystem>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/files.h"
#include "stability/outcome.h"
#include "stability/robustness.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

const std::string kPlane = "<geom type='plane' size='1 1 0.1'/>";
const std::string kTetrahedron = "<asset><mesh name='tetra' vertex='0 0 0 0.1 0 0 0 0.1 0 0 0 0.1'/></asset>";

class MjcfSceneTest : public testing::Test {
 protected:
  std::string file(const std::string& inside) { return raw("<mujoco>" + inside + "</mujoco>"); }
  std::string raw(const std::string& text) {
    const std::string path = directory_ / "scene.xml";
    write_file(path, text);
    return path;
  }
  // Bodies on a table.
  MjcfScene scene(const std::string& bodies, const std::string& before = "") {
    return MjcfScene(file(before + "<worldbody>" + kPlane + bodies + "</worldbody>"));
  }
  MjcfScene one(const std::string& geoms, const std::string& before = "") {
    return scene("<body name='b' pos='0 0 0.5'><freejoint/>" + geoms + "</body>", before);
  }
  // One line, about the file.
  void expect_refused(const std::string& path, const std::vector<std::string>& words) {
    refused([&] { MjcfScene{path}; }, words);
  }
  template <class Call>
  void refused(const Call& call, const std::vector<std::string>& words) {
    try {
      call();
      ADD_FAILURE() << "is not refused: " << words.front();
    } catch (const InputError& e) {
      const std::string line = e.what();
      EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 0) << line;
      EXPECT_THAT(line, HasSubstr(directory_.path().string()));
      for (const std::string& word : words) EXPECT_THAT(line, HasSubstr(word));
    }
  }
  TemporaryDirectory directory_;
};

TEST_F(MjcfSceneTest, DiametersOfAllGeoms) {
  const auto diameter_with = [&](const std::string& geoms) { return one(geoms, kTetrahedron).bodies().at(1).diameter; };
  EXPECT_NEAR(diameter_with("<geom type='sphere' size='0.1'/>"), 0.2, 1e-12);
  EXPECT_NEAR(diameter_with("<geom type='capsule' size='0.1 0.2'/>"), 0.6, 1e-12);
  EXPECT_NEAR(diameter_with("<geom type='cylinder' size='0.1 0.2'/>"), std::hypot(0.2, 0.4), 1e-12);
  EXPECT_NEAR(diameter_with("<geom type='box' size='0.1 0.2 0.3'/>"), 2.0 * Vector3d(0.1, 0.2, 0.3).norm(), 1e-12);
  for (const char* size : {"0.3 0.1 0.2", "0.1 0.3 0.2", "0.2 0.1 0.3"}) {
    EXPECT_NEAR(diameter_with("<geom type='ellipsoid' size='" + std::string(size) + "'/>"), 0.6, 1e-12);
  }
  EXPECT_NEAR(diameter_with("<geom type='mesh' mesh='tetra'/>"), 0.1 * std::sqrt(2.0), 1e-7);
  // A ball and a turned box: from the corner through the ball's middle.
  EXPECT_NEAR(diameter_with("<geom size='0.1' pos='-1 0 0'/><geom type='box' size='.1 .1 .1' pos='1 0 0'/>"),
              Vector3d(2.1, 0.1, 0.1).norm() + 0.1, 1e-12);
  // What is only shown does not count.
  EXPECT_NEAR(diameter_with("<geom size='0.1'/><geom size='1' contype='0' conaffinity='0' mass='0'/>"), 0.2, 1e-12);
  EXPECT_TRUE(std::isinf(one("<geom size='0.1'/>").bodies().at(0).diameter));  // the world with its plane
}

TEST_F(MjcfSceneTest, BodiesPosesAndMasses) {
  const MjcfScene nested = scene(
      "<body name='fixed' pos='2 0 0'><geom size='0.1'/><body pos='0 0 1'><geom size='0.2'/></body></body>"
      "<body name='free' pos='0 0 1'><freejoint/><geom size='0.1' mass='3'/>"
      "<body name='grown' pos='0 0 0.5' euler='0 0 90'><geom type='box' size='.1 .1 .1' pos='0.2 0 0' mass='1'/></body>"
      "</body><body mocap='true' name='led'><geom size='0.1'/></body><body name='bare'/>");
  std::vector<std::string> names;
  for (const SceneBody& body : nested.bodies()) names.push_back(body.name);
  EXPECT_EQ(names, (std::vector<std::string>{"world", "fixed", "body 2", "free", "grown", "led"}));
  EXPECT_EQ(nested.moving(), (std::vector<int>{3, 4}));
  EXPECT_NEAR(nested.bodies()[3].mass, 3.0, 1e-12);
  const std::vector<Pose> poses = nested.initial_poses();
  EXPECT_TRUE(poses[2].translation().isApprox(Vector3d(2, 0, 1)));
  EXPECT_TRUE(poses[4].translation().isApprox(Vector3d(0, 0.2, 1.5)));  // the centre of mass, 0.2 along a turned x
  EXPECT_NEAR(rotation_angle(poses[4].linear()), M_PI / 2, 1e-9);
}

TEST_F(MjcfSceneTest, EveryGeomFallsAndRestsAtItsHeight) {
  const struct {
    const char* geom;
    double height;  // of the centre of mass at rest; the soft contacts of a file's defaults give way by a millimetre
  } cases[] = {{"<geom type='sphere' size='0.1'/>", 0.1},
               {"<geom type='box' size='0.1 0.2 0.05'/>", 0.05},
               {"<geom type='cylinder' size='0.1 0.05'/>", 0.05},
               {"<geom type='capsule' size='0.05 0.1' euler='90 0 0'/>", 0.05},
               {"<geom type='ellipsoid' size='0.1 0.1 0.04'/>", 0.04},
               {"<geom type='mesh' mesh='tetra'/>", 0.025}};
  for (const auto& [geom, height] : cases) {
    const MjcfScene file = scene("<body pos='0 0 0.12'><freejoint/>" + std::string(geom) + "</body>", kTetrahedron);
    PhysicsOptions options;
    options.time_limit = 8.0;
    const SettleResult settled = file.settle(options);
    EXPECT_EQ(settled.status, SettleStatus::kSettled) << geom;
    EXPECT_NEAR(settled.T_world_object.at(0).translation().z(), height, 2e-3) << geom;
    EXPECT_EQ(settled.touching, (std::vector<std::pair<int, int>>{{-1, 0}})) << geom;
  }
}

TEST_F(MjcfSceneTest, APendulumComesToRestHanging) {
  // Its centre of mass lies 0.3 out along x and 0.1 along z, at atan(0.3 / 0.1) from the vertical below the hinge: the
  // bob must turn by pi minus that about +y, x going down.
  const MjcfScene file(
      MjcfScene(this->file("<worldbody><body name='bob' pos='0 0 1'><joint type='hinge' axis='0 1 0' damping='0.05'/>"
                           "<geom size='0.05' pos='0.3 0 0.1' mass='0.5'/></body></worldbody>")));
  PhysicsOptions options;
  options.time_limit = 60.0;
  options.rest_turn = options.rest_shift = 1e-5;  // so that turning back does not pass for rest
  const SettleResult settled = file.settle(options);
  EXPECT_EQ(settled.status, SettleStatus::kSettled);
  const Vector3d turned = so3_log(settled.T_world_object.at(0).linear());
  EXPECT_NEAR(turned.y(), M_PI - std::atan2(0.3, 0.1), 1e-3);  // the tail of its damped swing
  EXPECT_NEAR(settled.T_world_object[0].translation().z(), 1.0 - std::hypot(0.3, 0.1), 1e-5);
}

TEST_F(MjcfSceneTest, TheFilesOwnSettingsHold) {
  const std::string ball = "<worldbody><body pos='0 0 100'><freejoint/><geom size='0.1'/></body></worldbody>";
  const MjcfScene moon(file("<option gravity='0 0 -1.6' timestep='0.01'/>" + ball));
  PhysicsOptions options;
  options.time_limit = 1.0;
  const SettleResult falling = moon.settle(options);
  EXPECT_EQ(falling.status, SettleStatus::kTimeLimit);
  EXPECT_NEAR(falling.seconds, 1.0, 1e-9);
  // Semi-implicit Euler, n steps of h: g h^2 n (n + 1) / 2.
  EXPECT_NEAR(100.0 - falling.T_world_object.at(0).translation().z(), 1.6 * 1e-4 * 100 * 101 / 2, 1e-9);
  EXPECT_EQ(falling.T_world_object[0].matrix(), moon.settle(options).T_world_object[0].matrix());
}

TEST_F(MjcfSceneTest, NothingThatMovesIsASettledScene) {
  const MjcfScene still = scene("");
  const SettleResult settled = still.settle();
  EXPECT_EQ(settled.status, SettleStatus::kSettled);
  EXPECT_TRUE(settled.T_world_object.empty());
  EXPECT_TRUE(still.to_scene().objects.empty());
}

TEST_F(MjcfSceneTest, KeyframesByNameAndNumber) {
  const std::string path = file("<worldbody>" + kPlane +
                                "<body><freejoint/><geom size='0.1'/></body></worldbody>"
                                "<keyframe><key name='high' time='3' qpos='0 0 2 1 0 0 0'/>"
                                "<key qpos='0 0 0.1 1 0 0 0' qvel='0.5 0 0 0 0 0'/>"
                                "<key name='bad' qpos='inf 0 0 1 0 0 0'/></keyframe>");
  EXPECT_NEAR(MjcfScene(path).initial_poses()[1].translation().z(), 0.0, 1e-12);
  EXPECT_NEAR(MjcfScene(path, "high").initial_poses()[1].translation().z(), 2.0, 1e-12);
  EXPECT_NEAR(MjcfScene(path, "0").to_scene().T_world_object[0].translation().z(), 2.0, 1e-12);
  PhysicsOptions options;
  options.time_limit = 1.0;
  const SettleResult rolled = MjcfScene(path, "1").settle(options);
  EXPECT_GT(rolled.T_world_object[0].translation().x(), 0.2);
  EXPECT_GT(MjcfScene(path, "high").settle(options).seconds, 0.5);  // from 0, not from the keyframe's 3 s
  refused([&] { MjcfScene(path, "low"); }, {"no keyframe 'low'", "0 (high), 1, 2 (bad)"});
  refused([&] { MjcfScene(path, "bad"); }, {"keyframe 'bad' is not finite"});
  refused([&] { MjcfScene(file("<worldbody>" + kPlane + "</worldbody>"), "0"); }, {"none at all"});
}

TEST_F(MjcfSceneTest, BadFilesAreRefusedInOneLine) {
  const std::string ball = "<body><freejoint/><geom size='0.1'/></body>";
  expect_refused(directory_ / "none.xml", {"none.xml", "no such MJCF file"});
  expect_refused(directory_.path(), {"no such MJCF file"});
  expect_refused(raw(""), {"scene.xml", "EMPTY_DOCUMENT"});
  expect_refused(raw("<mujoco><worldbody>"), {"MISMATCHED_ELEMENT"});
  expect_refused(raw("<house/>"), {"Unrecognized XML model type: 'house'"});
  expect_refused(file("<include file='part.xml'/>"), {"FILE_NOT_FOUND", "part.xml"});
  expect_refused(file("<asset><mesh name='m' file='cup.stl'/></asset>"), {"cup.stl"});
  expect_refused(file("<worldbody><geom type='ball' size='1'/></worldbody>"), {"invalid keyword: 'ball'"});
  expect_refused(file(""), {"empty scene"});
  expect_refused(file("<worldbody/>"), {"empty scene"});
  expect_refused(file("<worldbody><body><freejoint/><geom size='nan'/></body></worldbody>"), {"scene.xml"});
  expect_refused(file("<worldbody><geom size='nan'/></worldbody>"), {"'NaN'"});
  expect_refused(file("<worldbody><geom size='inf'/></worldbody>"), {"'world'", "not finite"});
  expect_refused(file("<worldbody><body name='b' pos='inf 0 0'><freejoint/><geom size='1'/></body></worldbody>"),
                 {"pose of 'b' is not finite"});
  expect_refused(file("<worldbody><body name='b'><freejoint/><geom size='1e200'/></body></worldbody>"),
                 {"mass of 'b' is not finite"});
  expect_refused(file("<worldbody><body name='b' pos='nan 0 0'><freejoint/><geom size='1'/></body></worldbody>"),
                 {"'NaN'"});
  for (const char* step : {"0", "-0.1", "inf"}) {
    expect_refused(file("<option timestep='" + std::string(step) + "'/><worldbody>" + ball + "</worldbody>"),
                   {"time step"});
  }
  expect_refused(file("<option gravity='0 0 -inf'/><worldbody>" + ball + "</worldbody>"), {"gravity"});
  expect_refused(file("<worldbody>" + ball + "</worldbody><keyframe><key qpos='1 2'/></keyframe>"), {"qpos"});
}

TEST_F(MjcfSceneTest, WhatCrashesMujocosCompilerIsRefusedToo) {
  const auto with_mesh = [&](const std::string& mesh) {
    return file("<asset><mesh name='m' " + mesh +
                "/></asset><worldbody><body><freejoint/><geom type='mesh' mesh='m'/></body></worldbody>");
  };
  expect_refused(with_mesh("vertex='0 0 0 1 0 0 0 1 0 0 0 1' face='0 1 -99999999 1 3 2 0 1 3 0 2 3'"), {"crashes"});
  expect_refused(with_mesh("vertex='0 0 0 1 0 0 0 1 0 1 1 0' face='0 1 2 1 3 2'"), {"scene.xml"});  // flat
  expect_refused(file("<size nuser_geom='2000000000'/><worldbody><geom size='1'/></worldbody>"), {"scene.xml"});
  std::mt19937 junk(1);
  std::string bytes(5'000'000, '\0');
  for (char& c : bytes) c = static_cast<char>(junk());
  expect_refused(raw(bytes), {"scene.xml"});
}

TEST_F(MjcfSceneTest, AStackThatOverflowsIsAnErrorOfTheFile) {
  // Room enough for balls in the air, not for all of them on the table.
  std::string balls;
  for (int i = 0; i < 30; ++i) {
    balls += "<body pos='" + std::to_string(i) + " 0 0.4'><freejoint/><geom size='0.1'/></body>";
  }
  const MjcfScene small = scene(balls, "<size nstack='20000'/>");
  for (int again = 0; again < 2; ++again) refused([&] { small.settle(); }, {"scene.xml", "Stack overflow"});
  PhysicsOptions options;
  options.time_limit = 0.1;
  EXPECT_EQ(small.settle(options).status, SettleStatus::kTimeLimit);  // still in the air
  refused([&] { scene(balls, "<option timestep='1e-9'/>").settle(); }, {"time step"});
}

TEST_F(MjcfSceneTest, MujocosSamplesAreScenes) {
  const std::filesystem::path samples = "/usr/share/mujoco/model";
  if (!std::filesystem::exists(samples)) GTEST_SKIP() << "needs Debian's libmujoco-samples";
  for (const char* name : {"humanoid/humanoid.xml", "mug/mug.xml", "slider_crank/slider_crank.xml", "flag/flag.xml"}) {
    const MjcfScene sample(samples / name);
    PhysicsOptions options;
    options.time_limit = 0.5;
    const SettleResult settled = sample.settle(options);
    EXPECT_NE(settled.status, SettleStatus::kDiverged) << name;
    EXPECT_EQ(settled.T_world_object.size(), sample.moving().size()) << name;
  }
}

}  // namespace
}  // namespace dofusion
