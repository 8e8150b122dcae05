// Images, cameras and clouds that make no sense, or are very large or very small: a clear result or a clear error, in
// bounded time, from every stage between a depth image and a scene.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "perception/geom_scanner.h"
#include "perception/known_recovery.h"
#include "perception/pcl_conversions.h"
#include "perception/scanner.h"
#include "perception/segmentation.h"
#include "perception/sensor_noise.h"
#include "perception/synthetic_view.h"
#include "perception/unknown_recovery.h"

namespace dofusion {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

Camera small_camera() { return {300.0, 300.0, 79.5, 59.5, 160, 120, 0.1}; }

// The camera's size kept, the pixels stretched: 4096 x 3072 sees what 160 x 120 does.
Camera scaled_camera(int width, int height) {
  const Camera camera = small_camera();
  const double x = width / 160.0, y = height / 120.0;
  return {camera.fx * x, camera.fy * y, (width - 1) / 2.0, (height - 1) / 2.0, width, height, 0.1};
}

Pose above(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

Scene two_blocks() {
  return {{make_block("cube"), make_block("half_rectangle")}, {above(-0.06, 0, 0.025), above(0.07, 0.02, 0.0125)}};
}

DepthImage noisy_view(const Scene& scene, const Camera& camera, const Pose& T_world_camera) {
  Scanner scanner(scene.objects);
  scanner.set_poses(scene.T_world_object);
  Rng rng = make_rng(4);
  return apply_sensor_noise(scanner.render(camera, T_world_camera), camera, SensorModel::kRealsense, 1.0, rng);
}

const Pose kView = look_at({0.1, -0.5, 0.45}, {0.0, 0.0, 0.0});

struct Recovered {
  bool table = false;
  int labels = 0;  // objects of the segmentation
  std::vector<RecoveredObject> unknown, known;
};

// Everything between a depth image and a scene.
Recovered recover(const DepthImage& depth, const Camera& camera) {
  Recovered result;
  const std::optional<Table> table = find_table(depth, camera);
  if (!table) return result;
  result.table = true;
  EXPECT_TRUE(table->T_world_camera.matrix().allFinite());
  const LabelImage labels = segment(depth, camera, *table);
  result.labels = count_objects(labels);
  result.unknown = recover_unknown(depth, camera, *table, labels);
  result.known = recover_known(depth, camera, *table, labels, all_blocks());
  for (const auto* objects : {&result.unknown, &result.known}) {
    for (const RecoveredObject& object : *objects) EXPECT_TRUE(object.T_world_object.matrix().allFinite());
  }
  return result;
}

TEST(BadInput, ImagesOfOneValueHoldNoTable) {
  const Camera camera = small_camera();
  for (const float z : {0.0F, -1.0F, kNaN, kInfinity, -kInfinity, 1e30F, 1e-30F}) {
    EXPECT_FALSE(recover(DepthImage(camera.width, camera.height, z), camera).labels > 0) << z;
  }
}

TEST(BadInput, BadReadingsCountAsNone) {
  const Camera camera = small_camera();
  DepthImage depth = noisy_view(two_blocks(), camera, kView), without = depth;
  Rng rng = make_rng(5);
  for (std::size_t i = 0; i < depth.pixels.size(); i += 7) {
    const float bad[] = {kNaN, kInfinity, -kInfinity, -0.5F};
    depth.pixels[i] = bad[uniform_int(rng, 0, 3)];
    without.pixels[i] = 0.0F;
  }
  const std::optional<Table> table = find_table(depth, camera), expected = find_table(without, camera);
  ASSERT_TRUE(table && expected);
  EXPECT_EQ(table->T_world_camera.matrix(), expected->T_world_camera.matrix());
  EXPECT_EQ(segment(depth, camera, *table).pixels, segment(without, camera, *expected).pixels);
  const Recovered found = recover(depth, camera);
  EXPECT_EQ(found.known.size(), 2u);
  EXPECT_EQ(found.unknown.size(), 2u);
}

TEST(BadInput, AFocalLengthOfZeroIsACallersMistake) {
  Camera camera = small_camera();
  const DepthImage depth = noisy_view(two_blocks(), camera, kView);
  const Table table = *find_table(depth, camera);
  const LabelImage labels = segment(depth, camera, table);
  for (const double focal_length : {0.0, -1.0, std::nan("")}) {
    camera.fx = focal_length;
    EXPECT_THROW(find_table(depth, camera), std::invalid_argument);
    EXPECT_THROW(segment(depth, camera, table), std::invalid_argument);
    EXPECT_THROW(recover_unknown(depth, camera, table, labels), std::invalid_argument);
    EXPECT_THROW(recover_known(depth, camera, table, labels, all_blocks()), std::invalid_argument);
    EXPECT_THROW(to_cloud(depth, camera), std::invalid_argument);
    EXPECT_THROW(Scanner({}).render(camera, kView), std::invalid_argument);
    EXPECT_THROW(GeomScanner({}).render(camera, kView), std::invalid_argument);
  }
}

TEST(BadInput, CamerasInsideAnObjectOrBelowTheTable) {
  const Camera camera = small_camera();
  const Scene box{{make_box("hall", {2.0, 2.0, 2.0})}, {above(0, 0, 1.0)}};
  // From inside, the walls are seen; the floor or a wall is the largest plane.
  const Recovered inside = recover(noisy_view(box, camera, look_at({0.1, -0.5, 0.5}, {0, 0, 0})), camera);
  EXPECT_TRUE(inside.table);
  // From below, the table's lower side: a plane, with nothing between it and the camera.
  const Recovered below = recover(noisy_view(two_blocks(), camera, look_at({0.1, -0.5, -0.5}, {0, 0, 0})), camera);
  EXPECT_TRUE(below.table);
  EXPECT_EQ(below.labels, 0);
}

TEST(BadInput, ScannersShowWhatIsSeenFromInsideAndFromBelow) {
  const Camera camera = small_camera();
  const Pose centre = look_at({0, 0, 1}, {1, 0, 1}), below = look_at({0, 0, -1}, {0, 0.01, 0});
  Geom ball;
  ball.size.x() = 1.0;
  GeomScanner geoms({ball});
  geoms.set_poses({above(0, 0, 1)});
  // The far wall at the pixel in the middle, half a pixel (1/600 rad) off the axis.
  EXPECT_NEAR(geoms.render(camera, centre).depth.at(60, 80), 1.0, 1e-5);
  Scanner hall({make_box("hall", {2.0, 2.0, 2.0})});
  hall.set_poses({above(0, 0, 1)});
  EXPECT_NEAR(hall.render(camera, centre).depth.at(60, 80), 1.0, 1e-5);
  EXPECT_NEAR(Scanner({}).render(camera, below).depth.at(60, 80), 1.0, 0.01);
  EXPECT_NE(viewpoint_problem({{make_box("hall", {2.0, 2.0, 2.0})}, {above(0, 0, 1)}}, centre), "");
  EXPECT_NE(viewpoint_problem({}, below), "");
}

TEST(BadInput, ImagesOfOnePixelAndOfOneRow) {
  for (const auto& [width, height] : {std::pair{1, 1}, {640, 1}, {1, 480}, {2, 2}}) {
    const Camera camera = scaled_camera(width, height);
    EXPECT_EQ(recover(DepthImage(width, height, 0.7F), camera).labels, 0);
    const Scan scan = Scanner({}).render(camera, kView);
    Rng rng = make_rng(1);
    EXPECT_EQ(apply_sensor_noise(scan, camera, SensorModel::kKinect, 1.0, rng).width, width);
    EXPECT_EQ(to_cloud(scan.depth, camera).size(), static_cast<std::size_t>(width) * height);
  }
}

// The stages after these: tests/apps/place_odd_input_test.cpp.
TEST(BadInput, TwelveMegapixels) {
  const Camera camera = scaled_camera(4096, 3072);
  const std::optional<Table> table = find_table(Scanner({}).render(camera, kView).depth, camera);
  ASSERT_TRUE(table);
  EXPECT_NEAR(table->T_world_camera.translation().z(), 0.45, 1e-3);
}

TEST(BadInput, ObjectsCutByTheImagesBorder) {
  for (const double shift : {-60.0, 60.0}) {
    Camera camera = small_camera();
    camera.cx += shift;
    const Recovered found = recover(noisy_view(two_blocks(), camera, kView), camera);
    EXPECT_GE(found.labels, 1) << shift;
    EXPECT_GE(found.unknown.size(), 1u) << shift;
  }
}

TEST(BadInput, ATableCoveredCompletelyIsNotSeen) {
  const Scene lid{{make_box("lid", {1.5, 1.5, 0.1})}, {above(0, 0, 0.05)}};
  const Camera camera = small_camera();
  const Recovered found = recover(noisy_view(lid, camera, kView), camera);
  EXPECT_TRUE(found.table);  // the lid's top is the one plane there is
  EXPECT_EQ(found.labels, 0);
}

TEST(BadInput, AMillionRandomPoints) {
  Rng rng = make_rng(6);
  Cloud cloud;
  for (int i = 0; i < 1000000; ++i) {
    cloud.push_back({static_cast<float>(uniform(rng, -1, 1)), static_cast<float>(uniform(rng, -1, 1)),
                     static_cast<float>(uniform(rng, 0.2, 2))});
  }
  const std::optional<CloudView> view = view_cloud(cloud);
  ASSERT_TRUE(view);
  EXPECT_LE(view->camera.width, 640);
  EXPECT_EQ(recover(view->depth, view->camera).table, false);
  EXPECT_FALSE(segment_by_convexity(cloud));
  const std::optional<CloudSegmentation> found = segment_cloud(cloud);  // some plane holds a few of them
  EXPECT_TRUE(!found || found->labels.size() == cloud.size());
}

TEST(BadInput, CloudsWithoutAPinholeView) {
  EXPECT_FALSE(view_cloud(Cloud{}));
  EXPECT_FALSE(segment_cloud(Cloud{}));
  Cloud odd;
  for (int i = 0; i < 100; ++i) odd.push_back({kNaN, 0.0F, 1.0F});
  EXPECT_FALSE(view_cloud(odd));
  // A needle: as many rows as a virtual camera would need are more than memory holds.
  Cloud needle;
  for (int i = 0; i < 1000; ++i) needle.push_back({1e-7F * static_cast<float>(i % 2), 0.001F * i, 1.0F});
  const std::optional<CloudView> thin = view_cloud(needle);
  EXPECT_TRUE(!thin || thin->depth.pixels.size() <= 640u * 4u * 640u);
}

}  // namespace
}  // namespace dofusion
