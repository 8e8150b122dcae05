#include "perception/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/files.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

const Camera kCamera{525.0, 520.0, 319.5, 239.5, 640, 480, 0.1};

TEST(Camera, ProjectUndoesUnproject) {
  const Eigen::Vector3d p = unproject(kCamera, 12.25, 400.5, 0.8);
  EXPECT_DOUBLE_EQ(p.z(), 0.8);
  // A few roundings of numbers of some hundred pixels.
  EXPECT_LT((project(kCamera, p) - Eigen::Vector2d(12.25, 400.5)).norm(), 1e-10);
}

TEST(Camera, LookAtPutsTheTargetOnTheOpticalAxisAndWorldUpInTheImage) {
  const Eigen::Vector3d eye(0.3, -0.4, 0.5), target(0.1, 0.0, 0.02);
  const Pose T_camera_world = look_at(eye, target).inverse();
  EXPECT_LT((T_camera_world * eye).norm(), 1e-12);
  const Eigen::Vector3d seen = T_camera_world * target;
  EXPECT_NEAR(seen.x(), 0.0, 1e-12);
  EXPECT_NEAR(seen.y(), 0.0, 1e-12);
  EXPECT_NEAR(seen.z(), (target - eye).norm(), 1e-12);
  const Eigen::Vector3d up = T_camera_world.linear() * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(up.x(), 0.0, 1e-12);
  EXPECT_LT(up.y(), 0.0);  // the image's y points down
  EXPECT_NEAR(T_camera_world.linear().determinant(), 1.0, 1e-12);
}

TEST(Camera, LookAtRefusesViewsWithoutAnUp) {
  EXPECT_THROW(look_at({0, 0, 1}, {0, 0, 0}), std::invalid_argument);
  EXPECT_THROW(look_at({1, 2, 3}, {1, 2, 3}), std::invalid_argument);
}

TEST(Camera, FileRoundTripKeepsEveryField) {
  const TemporaryDirectory directory;
  const std::string path = directory / "camera.json";
  write_camera(kCamera, path);
  const Camera read = read_camera(path);
  EXPECT_EQ(read.fx, kCamera.fx);
  EXPECT_EQ(read.fy, kCamera.fy);
  EXPECT_EQ(read.cx, kCamera.cx);
  EXPECT_EQ(read.cy, kCamera.cy);
  EXPECT_EQ(read.width, kCamera.width);
  EXPECT_EQ(read.height, kCamera.height);
  EXPECT_EQ(read.depth_scale, kCamera.depth_scale);
}

struct BadCamera {
  const char* name;
  const char* text;
  const char* complaint;
};

class BadCameraFile : public testing::TestWithParam<BadCamera> {};

TEST_P(BadCameraFile, IsRefusedWithTheFileAndTheField) {
  const TemporaryDirectory directory;
  const std::string path = directory / "camera.json";
  write_file(path, GetParam().text);
  try {
    read_camera(path);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr(path), testing::HasSubstr(GetParam().complaint)));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Camera, BadCameraFile,
    testing::Values(
        BadCamera{"Missing", R"({"fx":1,"fy":1,"cx":0,"cy":0,"width":4,"height":4})", "\"depth_scale\" is missing"},
        BadCamera{"Text", R"({"fx":"1","fy":1,"cx":0,"cy":0,"width":4,"height":4,"depth_scale":1})", "\"fx\""},
        BadCamera{"Zero", R"({"fx":0,"fy":1,"cx":0,"cy":0,"width":4,"height":4,"depth_scale":1})", "\"fx\""},
        BadCamera{"Negative", R"({"fx":1,"fy":1,"cx":0,"cy":0,"width":-4,"height":4,"depth_scale":1})", "\"width\""},
        BadCamera{"Fraction", R"({"fx":1,"fy":1,"cx":0,"cy":0,"width":4,"height":4.5,"depth_scale":1})", "\"height\""},
        BadCamera{"Huge", R"({"fx":1,"fy":1,"cx":0,"cy":0,"width":4e9,"height":4,"depth_scale":1})", "\"width\""},
        BadCamera{"Infinite", R"({"fx":1e999,"fy":1,"cx":0,"cy":0,"width":4,"height":4,"depth_scale":1})", "JSON"},
        BadCamera{"Null", R"({"fx":null,"fy":1,"cx":0,"cy":0,"width":4,"height":4,"depth_scale":1})", "\"fx\""},
        BadCamera{"Array", "[1, 2]", "object"}, BadCamera{"Broken", R"({"fx": 1,)", "JSON"},
        BadCamera{"Empty", "", "JSON"}),
    [](const auto& bad) { return bad.param.name; });

TEST(Camera, MissingFileIsNamed) {
  try {
    read_camera("/nowhere/camera.json");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nowhere/camera.json"));
  }
}

}  // namespace
}  // namespace dofusion
