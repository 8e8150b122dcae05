#include "perception/segmentation.h"

#include <limits>

#include <gtest/gtest.h>

#include "box_image.h"
#include "perception/overlap_score.h"

namespace dofusion {
namespace {

const DepthSigma kSigma{0.0, 1.7e-3};
const Pose kView = look_at({0.1, -0.55, 0.5}, {0.0, 0.0, 0.03});

OverlapScore score(const std::vector<TriangleMesh>& meshes) {
  const BoxImage image = render_boxes(meshes, test_camera(), kView, kSigma, 4);
  const std::optional<Table> table = find_table(image.depth, test_camera());
  if (!table) return {};
  return score_segmentation(segment(image.depth, test_camera(), *table), image.labels);
}

// Noise of a millimetre moves a face's border by a pixel or so: objects of 100 pixels across keep 95 % of their area.
constexpr double kOverlap = 0.95;

TEST(Segmentation, PartsBoxesThatStandApart) {
  const OverlapScore s = score({upright_box({0.1, 0.06, 0.08}, {-0.09, 0, 0.04}, 0.3),
                                upright_box({0.06, 0.06, 0.12}, {0.09, 0.02, 0.06}, 0.9)});
  EXPECT_EQ(s.found, 2);
  EXPECT_GT(s.overlap_f, kOverlap);
}

TEST(Segmentation, PartsABoxFromTheOneItStandsOn) {
  const OverlapScore s =
      score({upright_box({0.2, 0.16, 0.05}, {0, 0, 0.025}, 0.2), upright_box({0.07, 0.07, 0.08}, {0, 0, 0.09}, 0.7)});
  EXPECT_EQ(s.found, 2);
  EXPECT_GT(s.overlap_f, kOverlap);
}

TEST(Segmentation, PartsABoxFromTheWallItTouches) {
  const OverlapScore s = score(
      {upright_box({0.24, 0.06, 0.15}, {0, 0.1, 0.075}, 0.0), upright_box({0.08, 0.08, 0.07}, {0, 0.03, 0.035}, 0.0)});
  EXPECT_EQ(s.found, 2);
  EXPECT_GT(s.overlap_f, kOverlap);
}

TEST(Segmentation, JoinsABoxBehindAnother) {
  const OverlapScore s = score(
      {upright_box({0.26, 0.06, 0.1}, {0, 0.08, 0.05}, 0.0), upright_box({0.05, 0.05, 0.2}, {0.02, -0.06, 0.1}, 0.5)});
  EXPECT_EQ(s.found, 2);
  EXPECT_GT(s.overlap_f, kOverlap);
}

TEST(Segmentation, FindsNothingOnAnEmptyTable) {
  const BoxImage image = render_boxes({}, test_camera(), kView, kSigma, 5);
  const std::optional<Table> table = find_table(image.depth, test_camera());
  ASSERT_TRUE(table);
  const LabelImage labels = segment(image.depth, test_camera(), *table);
  EXPECT_EQ(count_objects(labels), 0);
  EXPECT_GT(std::count(labels.pixels.begin(), labels.pixels.end(), kLabelTable), 0.98 * labels.pixels.size());
}

TEST(Segmentation, SurvivesImagesWithoutReadings) {
  const Camera camera = test_camera();
  const Table table = table_from_plane({0.0, 1.2, 1.2});
  for (const float z : {0.0F, -1.0F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(count_objects(segment(DepthImage(camera.width, camera.height, z), camera, table)), 0);
  }
  const Camera tiny{1.0, 1.0, 0.0, 0.0, 1, 1, 1.0};
  EXPECT_EQ(count_objects(segment(DepthImage(1, 1, 0.1F), tiny, table)), 0);
}

TEST(Segmentation, FollowsAUsersMask) {
  const BoxImage image = render_boxes(
      {upright_box({0.1, 0.06, 0.08}, {-0.09, 0, 0.04}, 0.3), upright_box({0.06, 0.06, 0.12}, {0.09, 0.02, 0.06}, 0.9)},
      test_camera(), kView, kSigma, 6);
  const std::optional<Table> table = find_table(image.depth, test_camera());
  ASSERT_TRUE(table);
  LabelImage mask(image.labels.width, image.labels.height, 0);
  for (std::size_t p = 0; p < mask.pixels.size(); ++p) mask.pixels[p] = image.labels.pixels[p] == 3 ? 255 : 0;
  const LabelImage labels = segment_with_mask(image.depth, test_camera(), *table, mask);
  ASSERT_EQ(count_objects(labels), 1);
  for (std::size_t p = 0; p < mask.pixels.size(); ++p) {
    if (labels.pixels[p] == 2) {
      EXPECT_EQ(image.labels.pixels[p], 3);
    }
  }
  EXPECT_THROW(segment_with_mask(image.depth, test_camera(), *table, LabelImage(2, 2)), std::invalid_argument);
}

TEST(OverlapScore, CountsAsXieEtAl) {
  LabelImage truth(4, 1), found(4, 1);
  truth.pixels = {2, 2, 3, 3};
  found.pixels = {2, 2, 2, 3};
  // Matched 2-2 (2 common of 3 and 2) and 3-3 (1 common of 1 and 2): P = R = 3/4.
  EXPECT_DOUBLE_EQ(score_segmentation(found, truth).overlap_f, 0.75);
  found.pixels = {3, 3, 2, 2};  // numbers do not matter
  EXPECT_DOUBLE_EQ(score_segmentation(found, truth).overlap_f, 1.0);
  EXPECT_DOUBLE_EQ(score_segmentation(found, truth).boundary_f, 1.0);
  truth.pixels = {2, 2, 0, 0};  // unlabelled pixels count for nobody
  found.pixels = {2, 2, 2, 2};
  EXPECT_DOUBLE_EQ(score_segmentation(found, truth).overlap_f, 1.0);
  found.pixels = {1, 1, 1, 1};
  EXPECT_DOUBLE_EQ(score_segmentation(found, truth).overlap_f, 0.0);
}

}  // namespace
}  // namespace dofusion
