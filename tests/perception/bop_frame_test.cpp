// Reads what write_bop_* wrote, and says what is wrong with a dataset.
#include "perception/bop_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "perception/bop_dataset.h"
#include "perception/depth_io.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using nlohmann::json;
using testing::HasSubstr;

const Camera kCamera{500.0, 510.0, 100.0, 80.0, 201, 161, 0.1};

// One scene with one image, of a cube from 1 m above.
struct Dataset {
  TemporaryDirectory directory;
  SyntheticView view;

  Dataset() {
    const Scene scene{{make_box("box", {0.1, 0.1, 0.1})}, {make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.05})}};
    view.T_world_camera = make_pose(Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix(), {0.02, 0.01, 1.0});
    Scanner scanner(scene.objects);
    scanner.set_poses(scene.T_world_object);
    view.truth = scanner.render(kCamera, view.T_world_camera);
    view.depth = view.truth.depth;
    const std::filesystem::path folder = directory.path() / "test" / bop_scene_name(3);
    const auto all = make_scene_scanner(scene);
    BopSceneWriter writer(scene, *all, {1}, folder);
    writer.add(0, kCamera, view, ColourImage(kCamera.width, kCamera.height));
    finish_bop_scene(folder, 1, scene);
  }
  std::string cameras() const { return (directory.path() / "test" / bop_scene_name(3) / "scene_camera.json").string(); }
};

std::string refusal(const Dataset& dataset, const std::string& split = "", int scene = 3, int image = 0) {
  try {
    find_bop_frame(dataset.directory.path(), split, scene, image);
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(BopFrame, IsWhatWasWritten) {
  const Dataset dataset;
  for (const char* split : {"", "test"}) {
    const BopFrame frame = find_bop_frame(dataset.directory.path(), split, 3, 0);
    EXPECT_EQ(frame.camera.fx, kCamera.fx);
    EXPECT_EQ(frame.camera.fy, kCamera.fy);
    EXPECT_EQ(frame.camera.cx, kCamera.cx);
    EXPECT_EQ(frame.camera.cy, kCamera.cy);
    EXPECT_EQ(frame.camera.width, kCamera.width);
    EXPECT_EQ(frame.camera.height, kCamera.height);
    EXPECT_EQ(frame.camera.depth_scale, kCamera.depth_scale);
    ASSERT_TRUE(frame.T_world_camera);
    EXPECT_TRUE(frame.T_world_camera->isApprox(dataset.view.T_world_camera, 1e-9));
    // Steps of 0.1 mm.
    EXPECT_NEAR(read_depth(frame.depth, frame.camera).at(80, 100), dataset.view.depth.at(80, 100), 6e-5);
  }
}

TEST(BopFrame, WithoutACamerasPoseThereIsNone) {
  const Dataset dataset;
  json cameras = json::parse(read_file(dataset.cameras()));
  cameras["0"].erase("cam_R_w2c");
  cameras["0"].erase("cam_t_w2c");
  write_file(dataset.cameras(), cameras.dump());
  EXPECT_FALSE(find_bop_frame(dataset.directory.path(), "", 3, 0).T_world_camera);
}

TEST(BopFrame, WhatIsMissingIsNamed) {
  const Dataset dataset;
  EXPECT_THAT(refusal(dataset, "", 4), HasSubstr("no split has a scene 000004"));
  EXPECT_THAT(refusal(dataset, "train"), HasSubstr("--split may be test"));
  EXPECT_THAT(refusal(dataset, "", 3, 7), HasSubstr("no image 7"));
  std::filesystem::create_directories(dataset.directory.path() / "val" / bop_scene_name(3));
  EXPECT_THAT(refusal(dataset), HasSubstr("one of test, val"));
  const json whole = json::parse(read_file(dataset.cameras()));
  for (const char* key : {"cam_K", "depth_scale", "cam_t_w2c"}) {
    json cameras = whole;
    cameras["0"].erase(key);
    write_file(dataset.cameras(), cameras.dump());
    EXPECT_THAT(refusal(dataset, "test"), HasSubstr(key));
  }
  json cameras = whole;
  cameras["0"]["cam_R_w2c"][0] = 2.0;
  write_file(dataset.cameras(), cameras.dump());
  EXPECT_THAT(refusal(dataset, "test"), HasSubstr("not a rotation"));
  write_file(dataset.cameras(), "{");
  EXPECT_THAT(refusal(dataset, "test"), HasSubstr("JSON"));
}

}  // namespace
}  // namespace dofusion
