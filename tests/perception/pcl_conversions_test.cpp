#include "perception/pcl_conversions.h"

#include <gtest/gtest.h>

#include "box_image.h"
#include "perception/segmentation.h"
#include "stability/files.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

const Pose kView = look_at({0.1, -0.55, 0.5}, {0.0, 0.0, 0.03});

BoxImage two_boxes() {
  return render_boxes(
      {upright_box({0.1, 0.06, 0.08}, {-0.09, 0, 0.04}, 0.3), upright_box({0.06, 0.06, 0.12}, {0.09, 0.02, 0.06}, 0.9)},
      test_camera(), kView, {0.0, 1.7e-3}, 9);
}

TEST(PclConversions, AnOrganisedCloudGivesImageAndCameraBack) {
  BoxImage image = two_boxes();
  image.depth.at(7, 9) = 0.0F;
  const std::optional<CloudView> view = view_cloud(to_cloud(image.depth, test_camera()));
  ASSERT_TRUE(view);
  EXPECT_NEAR(view->camera.fx, 525.0, 0.01);
  EXPECT_NEAR(view->camera.cx, 159.5, 0.01);
  EXPECT_EQ(view->depth.pixels, image.depth.pixels);
}

TEST(PclConversions, AnUnorganisedCloudIsSegmented) {
  const BoxImage image = two_boxes();
  Cloud cloud;
  for (const pcl::PointXYZ& p : to_cloud(image.depth, test_camera())) cloud.push_back(p);
  const std::optional<CloudSegmentation> found = segment_cloud(cloud);
  ASSERT_TRUE(found);
  EXPECT_EQ(*std::max_element(found->labels.begin(), found->labels.end()), 3);
  EXPECT_NEAR(found->table.T_world_camera.translation().z(), 0.5, 1e-3);
  const std::optional<CloudView> view = view_cloud(cloud);
  ASSERT_TRUE(view);
  const std::optional<Table> table = find_table(view->depth, view->camera);
  ASSERT_TRUE(table);
  EXPECT_EQ(count_objects(segment(view->depth, view->camera, *table)), 2);
}

// Nearly all points of either of two objects have one label, and not the other's.
void expect_parted(const LabelledCloud& cloud, const LabelImage& truth) {
  ASSERT_EQ(cloud.size(), truth.pixels.size());
  std::vector<int> most;
  for (const int object : {2, 3}) {
    std::vector<int> count(256, 0);
    int all = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      if (truth.pixels[i] != object) continue;
      ++count[cloud[i].label];
      ++all;
    }
    const auto largest = std::max_element(count.begin(), count.end());
    EXPECT_GT(*largest, 0.9 * all);
    most.push_back(static_cast<int>(largest - count.begin()));
    EXPECT_GE(most.back(), int{kLabelFirstObject});
  }
  EXPECT_NE(most[0], most[1]);
}

// Objects that touch are one cluster; their concave edge parts them, in organised clouds and others.
TEST(PclConversions, WhatTouchesPartsAtConcaveEdges) {
  const std::vector<std::vector<TriangleMesh>> scenes{
      {upright_box({0.2, 0.16, 0.05}, {0, 0, 0.025}, 0.2), upright_box({0.07, 0.07, 0.08}, {0, 0, 0.09}, 0.7)},
      {upright_box({0.24, 0.06, 0.15}, {0, 0.1, 0.075}, 0.0), upright_box({0.08, 0.08, 0.07}, {0, 0.03, 0.035}, 0.0)}};
  for (const std::vector<TriangleMesh>& boxes : scenes) {
    const BoxImage image = render_boxes(boxes, test_camera(), kView, {0.0, 1.7e-3}, 4);
    const Cloud cloud = to_cloud(image.depth, test_camera());
    const std::optional<CloudSegmentation> clusters = segment_cloud(cloud);
    ASSERT_TRUE(clusters);
    EXPECT_EQ(*std::max_element(clusters->labels.begin(), clusters->labels.end()), kLabelFirstObject);

    const std::optional<CloudSegmentation> parts = segment_by_convexity(cloud);
    ASSERT_TRUE(parts);
    const LabelledCloud out = labelled(cloud, parts->labels);
    EXPECT_EQ(out.width, cloud.width);
    EXPECT_EQ(out.height, cloud.height);
    expect_parted(out, image.labels);

    Cloud heap;  // the same points without their order
    for (const pcl::PointXYZ& p : cloud) heap.push_back(p);
    const std::optional<CloudSegmentation> heap_parts = segment_by_convexity(heap);
    ASSERT_TRUE(heap_parts);
    expect_parted(labelled(heap, heap_parts->labels), image.labels);
  }
  EXPECT_FALSE(segment_by_convexity({}));
  EXPECT_THROW(labelled(Cloud(2, 1), {1}), std::invalid_argument);
}

TEST(PclConversions, AnObjectsCloudLiesEvenlyOnItsSurface) {
  const ObjectPtr cube = make_block("cube");  // 50 mm
  const SurfaceCloud cloud = to_cloud(*cube, 600, 3);
  ASSERT_EQ(cloud.size(), 600u);
  int on_top = 0;
  for (const pcl::PointNormal& p : cloud) {
    const Eigen::Vector3f point = p.getVector3fMap(), normal = p.getNormalVector3fMap();
    EXPECT_NEAR(point.cwiseAbs().maxCoeff(), 0.025, 1e-7);
    EXPECT_NEAR(point.dot(normal), 0.025, 1e-7);
    on_top += normal.z() > 0.5F;
  }
  EXPECT_NEAR(on_top, 100, 10);
  EXPECT_EQ(to_cloud(*cube, 600, 3).points[5].x, cloud.points[5].x);
}

TEST(PclConversions, DegenerateCloudsGiveNothing) {
  EXPECT_FALSE(view_cloud({}));
  EXPECT_FALSE(segment_cloud({}));
  Cloud line;
  for (int i = 0; i < 10; ++i) line.push_back({0.0F, 0.0F, 1.0F});
  EXPECT_FALSE(view_cloud(line));
  EXPECT_THROW(read_cloud("no/such/file.pcd"), InputError);
  EXPECT_THROW(read_cloud("cloud.txt"), InputError);
}

}  // namespace
}  // namespace dofusion
