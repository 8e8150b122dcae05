#include "perception/scanner.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/shapes.h"

namespace dofusion {
namespace {

// Embree works in float: origin, direction and intersection each round by 6e-8 of coordinates around one metre, and
// a slanted surface magnifies that a few times.
constexpr double kFloatTolerance = 3e-6;

const Camera kCamera{500.0, 500.0, 100.0, 80.0, 201, 161, 1.0};

// One metre above the table, looking straight down, image x along world x.
Pose overhead(double height = 1.0) {
  return make_pose(Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix(), {0, 0, height});
}

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

long count(const LabelImage& labels, int label) {
  return std::count(labels.pixels.begin(), labels.pixels.end(), static_cast<std::uint8_t>(label));
}

TEST(Scanner, TableDepthIsThePlanesClosedForm) {
  const Scanner scanner({});
  const Pose T_world_camera = look_at({0.4, 0.3, 0.5}, {0, 0, 0});
  const Scan scan = scanner.render(kCamera, T_world_camera);
  for (int v = 0; v < kCamera.height; v += 7)
    for (int u = 0; u < kCamera.width; u += 7) {
      const Eigen::Vector3d ray = T_world_camera.linear() * unproject(kCamera, u, v, 1.0);
      EXPECT_NEAR(scan.depth.at(v, u), -T_world_camera.translation().z() / ray.z(), kFloatTolerance);
      EXPECT_EQ(scan.labels.at(v, u), kLabelTable);
      const Eigen::Vector3d normal = T_world_camera.linear() * scan.normals.at(v, u).cast<double>();
      EXPECT_LT((normal - Eigen::Vector3d::UnitZ()).norm(), 1e-6);
    }
}

TEST(Scanner, TableEndsAndIsOptional) {
  ScannerOptions options;
  options.table_half_size = 0.1;
  const Scan small = Scanner({}, options).render(kCamera, overhead());
  // 0.1 m at 1 m depth and 500 px focal length is 50 px either side of the centre.
  EXPECT_EQ(small.labels.at(80, 100 + 49), kLabelTable);
  EXPECT_EQ(small.labels.at(80, 100 + 51), kLabelNothing);
  EXPECT_EQ(small.depth.at(80, 100 + 51), 0.0f);
  EXPECT_EQ(small.normals.at(80, 100 + 51), Eigen::Vector3f::Zero());
  options.table = false;
  EXPECT_EQ(count(Scanner({}, options).render(kCamera, overhead()).labels, kLabelNothing), 201 * 161);
}

TEST(Scanner, TableIsSeenFromBelowAndNotFromWithin) {
  const Scanner scanner({});
  const Camera camera{100.0, 100.0, 2.0, 2.0, 5, 5, 1.0};
  const Pose below = make_pose(Eigen::Matrix3d::Identity(), {0.1, 0.2, -0.7});  // looks up
  EXPECT_NEAR(scanner.render(camera, below).depth.at(2, 2), 0.7, kFloatTolerance);
  EXPECT_EQ(scanner.render(camera, below).labels.at(2, 2), kLabelTable);
  // Along z = 0, in it and a hair above it: the middle row's rays never meet it.
  for (const double height : {0.0, 1e-3}) {
    const Pose level = look_at({0.5, 0, height}, {0, 0, height});
    const Scan scan = scanner.render(camera, level);
    for (const float depth : scan.depth.pixels) EXPECT_TRUE(std::isfinite(depth));
    EXPECT_EQ(scan.labels.at(2, 2), kLabelNothing) << height;
    EXPECT_FALSE(scanner.cast_ray({0.5, 0, height}, {-1, 0, 0}));
  }
}

TEST(Scanner, BoxEdgesAreAtTheirPixels) {
  Scanner scanner({make_box("box", {0.2, 0.1, 0.2})});
  scanner.set_poses({at(0, 0, 0.1)});
  const Scan scan = scanner.render(kCamera, overhead());
  // The top is at depth 0.8: half edges of 0.1 and 0.05 m are 62.5 and 31.25 px, so 125 x 63 pixel centres are on it.
  EXPECT_EQ(count(scan.labels, kLabelFirstObject), 125 * 63);
  EXPECT_EQ(count(scan.labels, kLabelTable), 201 * 161 - 125 * 63);
  EXPECT_EQ(scan.labels.at(80, 100 - 62), kLabelFirstObject);
  EXPECT_EQ(scan.labels.at(80, 100 - 63), kLabelTable);
  EXPECT_EQ(scan.labels.at(80 + 31, 100), kLabelFirstObject);
  EXPECT_EQ(scan.labels.at(80 + 32, 100), kLabelTable);
  EXPECT_NEAR(scan.depth.at(80, 100 - 62), 0.8, kFloatTolerance);
  EXPECT_NEAR(scan.depth.at(80, 100 - 63), 1.0, kFloatTolerance);
  EXPECT_LT((scan.normals.at(80, 100) - Eigen::Vector3f(0, 0, -1)).norm(), 1e-6);
}

TEST(Scanner, NormalsFollowTheObjectsRotation) {
  Scanner scanner({make_box("box", {0.1, 0.1, 0.1})});
  const Eigen::Matrix3d R = so3_exp({0.3, -0.5, 0.8});
  scanner.set_poses({make_pose(R, {0, 0, 0.2})});
  const Pose T_world_camera = look_at({0.5, 0.2, 0.6}, {0, 0, 0.2});
  const Scan scan = scanner.render(kCamera, T_world_camera);
  int seen = 0;
  for (std::size_t i = 0; i < scan.labels.pixels.size(); ++i) {
    if (scan.labels.pixels[i] != kLabelFirstObject) continue;
    ++seen;
    // In the box's frame a face's normal is a signed axis.
    const Eigen::Vector3d normal = R.transpose() * (T_world_camera.linear() * scan.normals.pixels[i].cast<double>());
    EXPECT_NEAR(normal.cwiseAbs().maxCoeff(), 1.0, 1e-6);
    EXPECT_NEAR(normal.norm(), 1.0, 1e-6);
    const int u = static_cast<int>(i) % kCamera.width, v = static_cast<int>(i) / kCamera.width;
    EXPECT_LT(scan.normals.pixels[i].cast<double>().dot(unproject(kCamera, u, v, 1.0)), 0.0) << "faces away";
  }
  EXPECT_GT(seen, 1000);
}

TEST(Scanner, NoRaySlipsBetweenTriangles) {
  // From inside a closed solid every ray must hit it, also through edges and corners.
  const ObjectPtr box = make_box("room", {1.0, 0.8, 0.6});
  ScannerOptions options;
  options.table = false;
  const Scanner scanner({box}, options);
  const Camera wide{50.0, 50.0, 100.0, 80.0, 201, 161, 1.0};
  for (const Eigen::Vector3d& target : {Eigen::Vector3d(0.5, 0.4, 0.3), Eigen::Vector3d(-0.5, 0.0, 0.1)}) {
    const Pose T_world_camera = look_at({0, 0, 0}, target);
    const Scan scan = scanner.render(wide, T_world_camera);
    for (int v = 0; v < wide.height; ++v)
      for (int u = 0; u < wide.width; ++u) {
        const Eigen::Vector3d ray = T_world_camera.linear() * unproject(wide, u, v, 1.0);
        const double expected = (0.5 * *box->box_edges).cwiseQuotient(ray.cwiseAbs()).minCoeff();
        ASSERT_NEAR(scan.depth.at(v, u), expected, kFloatTolerance) << u << ", " << v;
      }
  }
}

TEST(Scanner, WindowIsTheImagesPart) {
  Scanner scanner({make_block("cube"), make_block("hat")});
  scanner.set_poses({at(0, 0, 0.025), make_pose(so3_exp({0.2, 0.1, 0.4}), {0.06, 0.03, 0.04})});
  const Pose T_world_camera = look_at({0.3, 0.3, 0.4}, {0.02, 0.01, 0.02});
  const Scan whole = scanner.render(kCamera, T_world_camera);
  const int u0 = 51, v0 = 33, u1 = 150, v1 = 120, stride = 4;
  const Scan window = scanner.render_window(kCamera, T_world_camera, u0, v0, u1, v1, stride);
  ASSERT_EQ(window.depth.width, 25);
  ASSERT_EQ(window.depth.height, 22);
  for (int row = 0; row < window.depth.height; ++row)
    for (int column = 0; column < window.depth.width; ++column) {
      EXPECT_EQ(window.labels.at(row, column), whole.labels.at(v0 + stride * row, u0 + stride * column));
      EXPECT_NEAR(window.depth.at(row, column), whole.depth.at(v0 + stride * row, u0 + stride * column),
                  kFloatTolerance);
    }
  // A window may reach beyond the image; there it sees what a larger image would.
  const Scan beyond = scanner.render_window(kCamera, T_world_camera, -3, -2, 1, 1);
  EXPECT_EQ(beyond.depth.width, 4);
  EXPECT_NEAR(beyond.depth.at(2, 3), whole.depth.at(0, 0), kFloatTolerance);
}

TEST(Scanner, ThreadsAndKeptImagesMakeNoDifference) {
  const std::vector<ObjectPtr> objects{make_block("cube"), make_block("hat"), make_sphere("ball", 0.03)};
  const std::vector<Pose> poses{at(0, 0, 0.025), make_pose(so3_exp({0.2, 0.1, 0.4}), {0.06, 0.03, 0.04}),
                                at(-0.05, 0.05, 0.03)};
  ScannerOptions options;
  options.table_half_size = 0.1;  // so that there are rays that hit nothing
  Scanner plain(objects, options);
  options.threads = 3;
  Scanner threaded(objects, options);
  plain.set_poses(poses);
  threaded.set_poses(poses);
  const Pose near = look_at({0.3, 0.3, 0.4}, {0.02, 0.01, 0.02}), far = look_at({0.9, -0.6, 0.8}, {0, 0, 0});
  Scan kept;
  for (const auto& [width, height] : {std::pair{201, 161}, {201, 161}, {320, 240}, {3, 2}, {1, 1}})
    for (const Pose& T_world_camera : {near, far}) {
      const Camera camera{300.0, 300.0, width / 2.0, height / 2.0, width, height, 1.0};
      const Scan expected = plain.render(camera, T_world_camera);
      threaded.render(camera, T_world_camera, kept);  // over the scan before
      EXPECT_EQ(kept.depth.width, width);
      EXPECT_EQ(kept.normals.height, height);
      EXPECT_EQ(kept.depth.pixels, expected.depth.pixels);
      EXPECT_EQ(kept.labels.pixels, expected.labels.pixels);
      EXPECT_EQ(kept.normals.pixels, expected.normals.pixels);
    }
}

TEST(Scanner, EveryPixelIsTheRayThroughItsCentre) {
  // Also where a tile of the image lies on several triangles, half beside an object, or across the image's border.
  Scanner scanner({make_block("cube"), make_sphere("ball", 0.03)});
  scanner.set_poses({at(0, 0, 0.025), at(-0.05, 0.05, 0.03)});
  const Pose T_world_camera = look_at({0.3, 0.3, 0.4}, {0, 0, 0.02});
  const Scan scan = scanner.render(kCamera, T_world_camera);
  int disagreeing = 0;
  for (int v = 0; v < kCamera.height; ++v)
    for (int u = 0; u < kCamera.width; ++u) {
      const Eigen::Vector3d ray = unproject(kCamera, u, v, 1.0);
      const auto hit = scanner.cast_ray(T_world_camera.translation(), T_world_camera.linear() * ray);
      ASSERT_TRUE(hit);
      const Eigen::Vector3d normal = T_world_camera.linear().transpose() * hit->normal;
      const bool agrees = std::abs(hit->distance / ray.norm() - scan.depth.at(v, u)) < kFloatTolerance &&
                          scan.labels.at(v, u) == hit->object + kLabelFirstObject &&
                          (normal.cast<float>() - scan.normals.at(v, u)).norm() < 1e-5f;
      if (!agrees) ++disagreeing;
    }
  // A ray along the edge of two triangles may be told either one; the ball's are a third of a pixel wide.
  EXPECT_LE(disagreeing, 5);
}

TEST(Scanner, PosesAndVisibilityChangeTheNextScan) {
  const ObjectPtr cube = make_block("cube");
  Scanner scanner({cube, cube});  // two of the same share one tree
  scanner.set_poses({at(0, 0, 0.025), at(0, 0, 0.075)});
  EXPECT_NEAR(scanner.render(kCamera, overhead()).depth.at(80, 100), 0.9, kFloatTolerance);
  EXPECT_EQ(scanner.render(kCamera, overhead()).labels.at(80, 100), kLabelFirstObject + 1);
  scanner.set_visible(1, false);
  EXPECT_NEAR(scanner.render(kCamera, overhead()).depth.at(80, 100), 0.95, kFloatTolerance);
  scanner.set_visible(0, false);
  EXPECT_EQ(scanner.render(kCamera, overhead()).labels.at(80, 100), kLabelTable);
  scanner.set_visible(0, true);
  scanner.set_poses({at(0.1, 0, 0.125), at(0, 0, 0.075)});
  const Scan moved = scanner.render(kCamera, overhead());
  EXPECT_EQ(moved.labels.at(80, 100), kLabelTable);
  EXPECT_NEAR(moved.depth.at(80, 159), 0.85, kFloatTolerance);  // 0.1 m at depth 0.85 m is 58.8 px
}

TEST(Scanner, RaysHitKnownFaces) {
  Scanner scanner({make_block("cube"), make_block("rectangle")});
  scanner.set_poses({at(0, 0, 0.025), at(0.2, 0, 0.05)});
  const auto top = scanner.cast_ray({0.01, 0.02, 0.5}, {0, 0, -2});  // the direction's length does not matter
  ASSERT_TRUE(top);
  EXPECT_EQ(top->object, 0);
  EXPECT_NEAR(top->distance, 0.45, kFloatTolerance);
  EXPECT_LT((top->normal - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  const auto side = scanner.cast_ray({0.1, 0, 0.08}, {1, 0, 0});
  ASSERT_TRUE(side);
  EXPECT_EQ(side->object, 1);
  EXPECT_NEAR(side->distance, 0.075, kFloatTolerance);
  EXPECT_LT((side->normal + Eigen::Vector3d::UnitX()).norm(), 1e-12);
  const auto table = scanner.cast_ray({0.1, 0, 1}, {0, 0, -1});
  ASSERT_TRUE(table);
  EXPECT_EQ(table->object, -1);
  EXPECT_FALSE(scanner.cast_ray({0, 0, 1}, {0, 0, 1}));
}

TEST(Scanner, SegmentsAreOccludedByWhatLiesOnThem) {
  Scanner scanner({make_block("cube")});
  scanner.set_poses({at(0, 0, 0.025)});
  // Over the cube, through it, ending before it, under the table, and into the table.
  const std::vector<Scanner::Segment> segments{{{-0.1f, 0, 0.06f}, {0.1f, 0, 0.06f}},
                                               {{-0.1f, 0, 0.04f}, {0.1f, 0, 0.04f}},
                                               {{-0.1f, 0, 0.04f}, {-0.03f, 0, 0.04f}},
                                               {{-0.1f, 0, -0.01f}, {0.1f, 0, -0.01f}},
                                               {{0.1f, 0, 0.1f}, {0.2f, 0, -0.1f}}};
  EXPECT_THAT(scanner.occluded(segments), testing::ElementsAre(0, 1, 0, 0, 1));
  // More than one packet: every segment has its own answer.
  std::vector<Scanner::Segment> many;
  for (int i = 0; i < 100; ++i) many.push_back(segments[static_cast<std::size_t>(i % 5)]);
  const auto answers = scanner.occluded(many);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(answers[static_cast<std::size_t>(i)], i % 5 == 1 || i % 5 == 4) << i;
  EXPECT_TRUE(scanner.occluded({}).empty());
}

TEST(Scanner, EveryBlocksTopIsAtItsHeight) {
  for (const ObjectPtr& block : all_blocks()) {
    Scanner scanner({block});
    const BoundingBox box = bounding_box(block->mesh);
    scanner.set_poses({at(0, 0, -box.min.z())});
    const Scan scan = scanner.render(kCamera, overhead());
    float nearest = 2.0f;
    for (std::size_t i = 0; i < scan.depth.pixels.size(); ++i)
      if (scan.labels.pixels[i] == kLabelFirstObject) nearest = std::min(nearest, scan.depth.pixels[i]);
    // A ridge or an apex may pass between pixels, which are 2 mm apart.
    EXPECT_NEAR(nearest, 1.0 - (box.max.z() - box.min.z()), 0.004) << block->name;
    EXPECT_GE(nearest, 1.0 - (box.max.z() - box.min.z()) - kFloatTolerance) << block->name;
  }
}

TEST(Scanner, CallersMistakesThrow) {
  Scanner scanner({make_block("cube")});
  EXPECT_THROW(scanner.set_poses({}), std::invalid_argument);
  EXPECT_THROW(scanner.set_visible(1, true), std::invalid_argument);
  EXPECT_THROW(scanner.render({}, overhead()), std::invalid_argument);
  EXPECT_THROW(scanner.render_window(kCamera, overhead(), 5, 5, 5, 9), std::invalid_argument);
  EXPECT_THROW(scanner.render_window(kCamera, overhead(), 0, 0, 5, 9, 0), std::invalid_argument);
  EXPECT_THROW(scanner.cast_ray({0, 0, 1}, {0, 0, 0}), std::invalid_argument);
  EXPECT_THROW(Scanner(std::vector<ObjectPtr>(254, make_block("cube"))), std::invalid_argument);
  EXPECT_THROW(Scanner({}, {true, -1.0}), std::invalid_argument);
  EXPECT_THROW(Scanner({}, {true, 2.0, 0}), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
