#include "perception/bop_dataset.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "perception/depth_io.h"
#include "stability/files.h"
#include "stability/mesh_io.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using nlohmann::json;

const Camera kCamera{500.0, 500.0, 100.0, 80.0, 201, 161, 0.1};

Pose from_json(const json& rotation, const json& translation_mm) {
  Pose pose = Pose::Identity();
  for (int k = 0; k < 9; ++k) pose.linear()(k / 3, k % 3) = rotation.at(static_cast<std::size_t>(k)).get<double>();
  for (int k = 0; k < 3; ++k)
    pose.translation()[k] = translation_mm.at(static_cast<std::size_t>(k)).get<double>() / 1000.0;
  return pose;
}

// Two boxes seen from 1 m above, the second under the first and larger.
struct WrittenScene {
  TemporaryDirectory directory;
  Scene scene{
      {make_box("upper", {0.1, 0.1, 0.1}), make_box("lower", {0.2, 0.2, 0.1})},
      {make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.15}), make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.05})}};
  SyntheticView view;

  WrittenScene() {
    view.T_world_camera = make_pose(Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix(), {0.02, 0.01, 1.0});
    Scanner scanner(scene.objects);
    scanner.set_poses(scene.T_world_object);
    view.truth = scanner.render(kCamera, view.T_world_camera);
    view.depth = view.truth.depth;
    for (int u = 0; u < kCamera.width; ++u) view.depth.at(80, u) = 0.0f;  // a row without readings
    write_bop_models(scene.objects, kCamera, directory.path());
    const auto folder = directory.path() / "test" / bop_scene_name(0);
    const auto all = make_scene_scanner(scene);
    BopSceneWriter writer(scene, *all, {1, 2}, folder);
    writer.add(0, kCamera, view, ColourImage(kCamera.width, kCamera.height));
    finish_bop_scene(folder, 1, scene);
  }
  json read(const std::string& name) const { return json::parse(read_file(directory.path() / name)); }
  LabelImage mask(const std::string& name) const {
    return read_labels((directory.path() / "test/000000" / name).string(), kCamera);
  }
};

long set_pixels(const LabelImage& mask) { return std::count(mask.pixels.begin(), mask.pixels.end(), 255); }

TEST(BopDataset, ModelsAreInMillimetres) {
  const WrittenScene written;
  const TriangleMesh mesh = read_solid_mesh((written.directory.path() / "models/obj_000002.ply").string(), 0.001);
  EXPECT_NEAR(volume(mesh), 0.2 * 0.2 * 0.1, 1e-9);
  EXPECT_LT(centre_of_mass(mesh).norm(), 1e-7);  // metres; PLY holds floats
  const json info = written.read("models/models_info.json");
  EXPECT_NEAR(info["1"]["diameter"].get<double>(), 100.0 * std::sqrt(3.0), 1e-9);
  EXPECT_NEAR(info["2"]["min_z"].get<double>(), -50.0, 1e-9);
  EXPECT_NEAR(info["2"]["size_x"].get<double>(), 200.0, 1e-9);
  EXPECT_EQ(read_camera((written.directory.path() / "camera.json").string()).fx, kCamera.fx);
}

TEST(BopDataset, PosesPutModelsWhereTheImageShowsThem) {
  const WrittenScene written;
  const json truth = written.read("test/000000/scene_gt.json")["0"];
  const json cameras = written.read("test/000000/scene_camera.json")["0"];
  ASSERT_EQ(truth.size(), 2u);
  const Pose T_camera_world = from_json(cameras["cam_R_w2c"], cameras["cam_t_w2c"]);
  EXPECT_LT((T_camera_world.matrix() - written.view.T_world_camera.inverse().matrix()).norm(), 1e-12);
  EXPECT_EQ(cameras["cam_K"].get<std::vector<double>>(), (std::vector<double>{500, 0, 100, 0, 500, 80, 0, 0, 1}));
  EXPECT_EQ(cameras["depth_scale"], 0.1);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(truth[i]["obj_id"], static_cast<int>(i) + 1);
    const Pose T_camera_object = from_json(truth[i]["cam_R_m2c"], truth[i]["cam_t_m2c"]);
    EXPECT_LT((T_camera_object.matrix() - (T_camera_world * written.scene.T_world_object[i]).matrix()).norm(), 1e-12);
  }
}

TEST(BopDataset, DepthIsTheViews) {
  const WrittenScene written;
  const DepthImage depth = read_depth((written.directory.path() / "test/000000/depth/000000.png").string(), kCamera);
  for (std::size_t i = 0; i < depth.pixels.size(); ++i)
    ASSERT_NEAR(depth.pixels[i], written.view.depth.pixels[i], 0.05e-3 + 1e-6);  // half a step
}

TEST(BopDataset, MasksAreSilhouettesAndVisibleParts) {
  const WrittenScene written;
  const LabelImage upper = written.mask("mask/000000_000000.png"), lower = written.mask("mask/000000_000001.png");
  const LabelImage upper_seen = written.mask("mask_visib/000000_000000.png");
  const LabelImage lower_seen = written.mask("mask_visib/000000_000001.png");
  EXPECT_EQ(upper.pixels, upper_seen.pixels) << "nothing hides the upper box";
  for (std::size_t i = 0; i < lower.pixels.size(); ++i) {
    EXPECT_LE(lower_seen.pixels[i], lower.pixels[i]);
    // The upper box's silhouette lies within the lower one's; what it hides is exactly what is missing.
    EXPECT_EQ(lower.pixels[i] == 255, lower_seen.pixels[i] == 255 || upper.pixels[i] == 255) << i;
  }
  const json info = written.read("test/000000/scene_gt_info.json")["0"];
  EXPECT_EQ(info[0]["px_count_all"], set_pixels(upper));
  EXPECT_EQ(info[0]["px_count_visib"], set_pixels(upper_seen));
  EXPECT_EQ(info[0]["visib_fract"], 1.0);
  EXPECT_EQ(info[1]["px_count_all"], set_pixels(lower));
  EXPECT_NEAR(info[1]["visib_fract"].get<double>(),
              static_cast<double>(set_pixels(lower_seen)) / static_cast<double>(set_pixels(lower)), 1e-12);
  // The upper box's top is at depth 0.8: 0.1 m are 62.5 px, from -43.75 to 18.75 about the centre, since the camera is
  // 2 cm to the right of it; 1 cm in the other direction puts it from -25 to 37.5 (its edge on a pixel's centre). Of
  // the sides that the camera sees in perspective, at depth 0.9, nothing reaches beyond.
  const auto box = info[0]["bbox_obj"].get<std::vector<int>>();
  EXPECT_EQ(box[0], 57);
  EXPECT_EQ(box[2], 62);
  EXPECT_NEAR(box[1], 55, 1);
  EXPECT_NEAR(box[3], 62, 1);
  const long row =
      std::count(upper.pixels.begin() + 80 * kCamera.width, upper.pixels.begin() + 81 * kCamera.width, 255);
  EXPECT_EQ(info[0]["px_count_valid"], set_pixels(upper) - row);
}

TEST(BopDataset, SilhouettesGoOnBeyondTheImage) {
  WrittenScene written;
  SyntheticView aside = written.view;
  aside.T_world_camera.translation().x() += 0.2;
  const auto folder = written.directory.path() / "test" / bop_scene_name(1);
  const auto all = make_scene_scanner(written.scene);
  BopSceneWriter writer(written.scene, *all, {1, 2}, folder);
  writer.add(0, kCamera, aside, ColourImage(kCamera.width, kCamera.height));
  finish_bop_scene(folder, 1, written.scene);
  const json info = json::parse(read_file(folder / "scene_gt_info.json"))["0"][1];
  EXPECT_LT(info["bbox_obj"][0].get<int>(), 0);
  const LabelImage mask = read_labels((folder / "mask/000000_000001.png").string(), kCamera);
  EXPECT_GT(info["px_count_all"].get<long>(), set_pixels(mask));
}

TEST(BopDataset, CallersMistakesThrow) {
  const TemporaryDirectory directory;
  const Scene scene{{make_block("cube")}, {Pose::Identity()}};
  EXPECT_THROW(BopSceneWriter(scene, *make_scene_scanner(scene), {}, directory.path()), std::invalid_argument);
  EXPECT_THROW(BopSceneWriter(scene, *make_scene_scanner(scene), {1}, "/proc/nowhere"), InputError);
}

}  // namespace
}  // namespace dofusion
