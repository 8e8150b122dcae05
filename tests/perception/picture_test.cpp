#include "perception/picture.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perception/png.h"
#include "perception/synthetic_view.h"
#include "stability/files.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

const Camera kCamera{300.0, 300.0, 79.5, 59.5, 160, 120, 0.1};

Scene one_cube() { return {{make_block("cube")}, {make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.025})}}; }
Pose view() { return look_at({0.3, -0.3, 0.35}, {0, 0, 0.02}); }

int brightness(const Rgb& colour) { return colour[0] + colour[1] + colour[2]; }

// The pixel that sees a point of the world.
Rgb seen_at(const ColourImage& picture, const Pose& T_world_camera, const Eigen::Vector3d& point) {
  const Eigen::Vector2d pixel = project(kCamera, T_world_camera.inverse() * point);
  return picture.at(static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x())));
}

TEST(Picture, ObjectsWearTheirColoursAndTheQueryItsOwn) {
  const Eigen::Vector3d top(0, 0, 0.05);
  const Rgb plain = seen_at(shaded_picture(one_cube(), kCamera, view()), view(), top);
  EXPECT_GT(plain[2], plain[0]) << "the first object's colour is blue";
  PictureOptions options;
  options.highlighted = 0;
  const Rgb query = seen_at(shaded_picture(one_cube(), kCamera, view(), options), view(), top);
  EXPECT_GT(query[0], query[1]);
  EXPECT_GT(query[1], query[2]) << "the query's colour is orange";
}

TEST(Picture, TableIsLightGreyAndTheShadowDarker) {
  const Scene scene = one_cube();
  const ColourImage picture = shaded_picture(scene, kCamera, view());
  // The lamp stands to the viewer's left: the table right of the cube lies in its shadow, left of it in the light.
  const Eigen::Vector3d right = view().linear().col(0), middle(0, 0, 0);
  const Rgb shadow = seen_at(picture, view(), middle + 0.045 * right);
  const Rgb light = seen_at(picture, view(), middle - 0.1 * right);
  EXPECT_LT(brightness(shadow), brightness(light) - 60);
  EXPECT_GT(brightness(light), 3 * 170);
  EXPECT_LT(std::abs(light[0] - light[2]), 10);

  PictureOptions options;
  options.shadow_samples = options.ambient_samples = 0;
  const ColourImage unshadowed = shaded_picture(scene, kCamera, view(), options);
  EXPECT_NEAR(brightness(seen_at(unshadowed, view(), middle + 0.045 * right)), brightness(light), 20);
}

TEST(Picture, IsTheSameEveryTime) {
  EXPECT_EQ(shaded_picture(one_cube(), kCamera, view()).pixels, shaded_picture(one_cube(), kCamera, view()).pixels);
}

TEST(Picture, WithoutAnythingToSeeThereIsABackdrop) {
  ScannerOptions options;
  options.table = false;
  const ColourImage picture = shaded_picture(Scanner({}, options), kCamera, view());
  EXPECT_THAT(picture.pixels, testing::Each(picture.pixels.front()));
}

TEST(Picture, ColoursAreDistinct) {
  std::set<Rgb> colours{kQueryColour, kTableColour};
  for (int i = 0; i < 20; ++i) colours.insert(object_colour(i));
  EXPECT_EQ(colours.size(), 22u);
}

TEST(Picture, DepthRunsFromWarmToColdAndMissingIsBlack) {
  DepthImage depth(100, 1);
  for (int u = 0; u < 100; ++u) depth.at(0, u) = 0.5f + 0.01f * static_cast<float>(u);
  depth.at(0, 50) = 0.0f;
  const ColourImage picture = depth_picture(depth);
  EXPECT_GT(picture.at(0, 2)[0], picture.at(0, 2)[2]);
  EXPECT_LT(picture.at(0, 90)[0], picture.at(0, 90)[2]);
  EXPECT_EQ(picture.at(0, 50), (Rgb{0, 0, 0}));
  for (int u = 0; u < 100; ++u) EXPECT_TRUE(u == 50 || brightness(picture.at(0, u)) > 100) << u;
  EXPECT_THAT(depth_picture(DepthImage(3, 2)).pixels, testing::Each(Rgb{0, 0, 0}));
}

TEST(Picture, SegmentationShowsLabelsOverShading) {
  Scanner scanner(one_cube().objects);
  scanner.set_poses(one_cube().T_world_object);
  const Scan scan = scanner.render(kCamera, view());
  const ColourImage picture = segmentation_picture(scan.labels, scan.depth, kCamera);
  const Rgb top = seen_at(picture, view(), {0, 0, 0.05});
  EXPECT_GT(top[2], top[0]);
  const Rgb table = seen_at(picture, view(), {0.08, 0.08, 0});
  EXPECT_LT(std::abs(table[0] - table[2]), 10);
  // The two visible sides meet the camera at the same angle, the top at another.
  const Rgb left = seen_at(picture, view(), {0.0, -0.025, 0.02}), right = seen_at(picture, view(), {0.025, 0.0, 0.02});
  EXPECT_NEAR(brightness(left), brightness(right), 10);
  EXPECT_NE(brightness(left), brightness(top));
  EXPECT_THROW(segmentation_picture(LabelImage(2, 2), scan.depth, kCamera), std::invalid_argument);
  const ColourImage nothing = segmentation_picture(LabelImage(4, 4), DepthImage(4, 4), kCamera);
  EXPECT_THAT(nothing.pixels, testing::Each(Rgb{0, 0, 0}));
}

TEST(Picture, ResizedCameraSeesTheSame) {
  const Camera half = resized(kCamera, 0.5);
  EXPECT_EQ(half.width, 80);
  EXPECT_EQ(half.height, 60);
  const Eigen::Vector3d p(0.05, -0.02, 0.7);
  const Eigen::Vector2d whole_pixel = project(kCamera, p), half_pixel = project(half, p);
  // From the image's corner, half a pixel before the first centre, everything is half as far.
  EXPECT_LT((0.5 * (whole_pixel + Eigen::Vector2d(0.5, 0.5)) - (half_pixel + Eigen::Vector2d(0.5, 0.5))).norm(), 1e-10);
}

TEST(Picture, ZoomedCameraFramesTheScene) {
  const Scene scene = one_cube();
  const Camera close = zoomed_on(kCamera, view(), {scene}, 200);
  EXPECT_EQ(close.width, 200);
  EXPECT_EQ(close.height, 150);
  EXPECT_GT(close.fx, kCamera.fx);
  for (const Eigen::Vector3d& v : scene.objects[0]->mesh.vertices) {
    const Eigen::Vector2d pixel = project(close, view().inverse() * (scene.T_world_object[0] * v));
    EXPECT_TRUE(pixel.x() > 10 && pixel.x() < 190 && pixel.y() > 10 && pixel.y() < 140) << pixel.transpose();
  }
  EXPECT_EQ(zoomed_on(kCamera, view(), {}, 80).fx, 150.0);
}

TEST(Picture, JpegIsOne) {
  const std::string bytes = to_jpeg(ColourImage(16, 8, {200, 100, 50}));
  EXPECT_EQ(bytes.substr(0, 2), "\xff\xd8");
  EXPECT_EQ(bytes.substr(bytes.size() - 2), "\xff\xd9");
  EXPECT_THROW(to_jpeg(ColourImage()), std::invalid_argument);
}

TEST(Picture, PngIsAnRgbImageOfTheSize) {
  const TemporaryDirectory directory;
  const ColourImage picture(7, 5, {10, 20, 30});
  write_picture(picture, directory / "picture.png");
  const std::string bytes = read_file(directory / "picture.png");
  EXPECT_EQ(bytes, to_png(picture));
  const PngHeader header = check_png(bytes, "picture.png");
  EXPECT_EQ(header.width, 7);
  EXPECT_EQ(header.height, 5);
  EXPECT_EQ(header.bits, 8);
  EXPECT_EQ(header.channels, 3);
  EXPECT_THROW(to_png(ColourImage()), std::invalid_argument);
  EXPECT_THROW(write_picture(picture, "/nowhere/picture.png"), InputError);
}

}  // namespace
}  // namespace dofusion
