// Segmentation and model-free recovery on real Kinect frames with labels (mOSD), where these are present.

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "perception/depth_io.h"
#include "perception/overlap_score.h"
#include "perception/plausibility.h"
#include "perception/unknown_recovery.h"

namespace dofusion {
namespace {

const std::filesystem::path kFrames = std::filesystem::path(DOFUSION_REAL_DIR) / "mosd";
constexpr int kBoxes = 17;  // frames 0 … 16 show boxes that stand on the table
constexpr int kAll = 25;    // frames 17 … 24 stacked boxes

struct FrameResult {
  OverlapScore score;
  PlausibleScene plausible;
};

class RealFrames : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!std::filesystem::exists(kFrames / "camera.json")) return;
    const Camera camera = read_camera(kFrames / "camera.json");
    for (int n = 0; n < kAll; ++n) {
      const std::string stem = (kFrames / ("learn" + std::to_string(n))).string();
      const DepthImage depth = read_depth(stem + "_depth.png", camera);
      const LabelImage truth = read_labels(stem + "_label.png", camera);
      const std::optional<Table> table = find_table(depth, camera);
      ASSERT_TRUE(table) << "frame " << n;
      const LabelImage labels = segment(depth, camera, *table);
      results_.push_back({score_segmentation(labels, truth),
                          make_plausible(to_scene(recover_unknown(depth, camera, *table, labels)))});
    }
  }
  void SetUp() override {
    if (results_.empty())
      GTEST_SKIP() << "no real frames in " << kFrames << " (PointCloudLibrary/data, segmentation/mOSD)";
  }
  static std::vector<FrameResult> results_;
};
std::vector<FrameResult> RealFrames::results_;

TEST_F(RealFrames, BoxesAreCountedAndOverlap) {
  int right = 0;
  double overlap = 0.0;
  for (int n = 0; n < kBoxes; ++n) {
    right += results_[n].score.found == results_[n].score.true_objects;
    overlap += results_[n].score.overlap_f / kBoxes;
  }
  EXPECT_GE(right, 15);
  EXPECT_GE(overlap, 0.85);
}

TEST_F(RealFrames, StackedBoxesPartToo) {
  int right = 0;
  double overlap = 0.0, boundary = 0.0;
  for (const FrameResult& result : results_) {
    right += result.score.found == result.score.true_objects;
    overlap += result.score.overlap_f / kAll;
    boundary += result.score.boundary_f / kAll;
  }
  EXPECT_GE(right, 24);
  EXPECT_GE(overlap, 0.90);
  EXPECT_GE(boundary, 0.80);
}

TEST_F(RealFrames, RecoveredScenesStand) {
  int stand = 0;
  for (const FrameResult& result : results_) {
    const PlausibleScene& p = result.plausible;
    stand += p.status == SettleStatus::kSettled && p.moved_pct < 5.0 && p.moved_deg < 5.0;
  }
  EXPECT_GE(stand, 23);
}

}  // namespace
}  // namespace dofusion
