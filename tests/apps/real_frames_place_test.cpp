// The whole way on real Kinect frames of boxes and stacked boxes, where those files are present.
#include <gtest/gtest.h>

#include <filesystem>

#include "apps/place_job.h"

namespace dofusion {
namespace {

TEST(RealFrames, ACubeFindsAPlaceThatStandsOnNearlyAllOf25) {
  const std::string frames = std::string(DOFUSION_REAL_DIR) + "/mosd/";
  if (!std::filesystem::exists(frames + "learn0_depth.png")) {
    GTEST_SKIP() << "no real frames at " << frames << "; this test needs mOSD's learn0 to learn24 there";
  }
  int frames_with_a_placement = 0;
  for (int frame = 0; frame < 25; ++frame) {
    PlaceArguments arguments;
    arguments.depth = frames + "learn" + std::to_string(frame) + "_depth.png";
    arguments.camera = frames + "camera.json";
    arguments.query = "cube";
    arguments.placement.samples = 32;
    arguments.placement.threads = 2;
    const PlaceResult result = run_placement(load_inputs(arguments), arguments);
    EXPECT_TRUE(result.recovered.table.has_value()) << "frame " << frame;
    EXPECT_GE(result.recovered.objects.size(), 1u) << "frame " << frame;
    const bool stable = !result.placements.empty() && result.placements.front().stable;
    if (!stable) std::printf("frame %d: no stable placement\n", frame);
    frames_with_a_placement += stable ? 1 : 0;
  }
  EXPECT_GE(frames_with_a_placement, 22);
}

}  // namespace
}  // namespace dofusion
