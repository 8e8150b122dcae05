// dofusion-place on images that are valid but hold no answer, or an unusual one: a result that says so.
#include "perception/depth_io.h"
#include "perception/synthetic_view.h"
#include "stability/files.h"
#include "tests/apps/place_fixture.h"

namespace dofusion {
namespace {
using nlohmann::json;
using testing::HasSubstr;

class PlaceOddInputTest : public PlaceTest {
 protected:
  // Runs on the depth image, which must end well; no more memory than a few copies of the largest image below.
  json result_of(const DepthImage& depth, const Camera& camera, const std::vector<std::string>& arguments = {}) {
    write_scan({camera, depth, {}, Pose::Identity()});
    const CommandResult run = place(arguments);
    expect_success(run);
    said_ = run.out;
    EXPECT_LT(run.peak_mb, 3000.0);
    EXPECT_EQ(entries(out()).size(), 7u);
    EXPECT_EQ(segmentation(camera).width, camera.width);
    return run.status == 0 ? placements() : json();
  }
  std::string said_;
};

// A surface of random bumps without any plane.
DepthImage bumps(const Camera& camera) {
  Rng rng = make_rng(3);
  DepthImage depth(camera.width, camera.height);
  const double a = uniform(rng, 0, 6), b = uniform(rng, 0, 6);
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      const double wave = std::sin(u * 0.05 + a) * std::cos(v * 0.07 + b) + 0.5 * std::sin(u * 0.11 - v * 0.09);
      depth.at(v, u) = static_cast<float>(0.8 + 0.12 * wave + normal(rng, 0.03));
    }
  }
  return depth;
}

TEST_F(PlaceOddInputTest, EmptyTableIsPlacedOn) {
  const TestScan scan = scan_of({}, small_camera());
  const json result = result_of(scan.depth, scan.camera);
  EXPECT_EQ(result.at("status"), "no_object");
  EXPECT_TRUE(result.at("objects").empty());
  EXPECT_EQ(result.at("placements").size(), 4u);
  EXPECT_THAT(said_, HasSubstr("no object"));
}

TEST_F(PlaceOddInputTest, EmptyTableAmongKnownBlocks) {
  const TestScan scan = scan_of({}, small_camera());
  const json result = result_of(scan.depth, scan.camera, {"--objects", std::string(DOFUSION_ASSETS_DIR) + "/blocks"});
  EXPECT_EQ(result.at("status"), "no_object");
}

TEST_F(PlaceOddInputTest, WithoutATableThereIsNoPlacement) {
  const Camera camera = small_camera();
  const json result = result_of(bumps(camera), camera);
  EXPECT_EQ(result.at("status"), "no_table");
  EXPECT_TRUE(result.at("placements").empty());
  EXPECT_TRUE(result.at("objects").empty());
  EXPECT_THAT(said_, HasSubstr("no table"));
  EXPECT_THAT(read_file(out() + "/report.html"), HasSubstr("no table"));
}

TEST_F(PlaceOddInputTest, WhiteNoise) {
  const Camera camera = small_camera();
  Rng rng = make_rng(4);
  DepthImage depth(camera.width, camera.height);
  for (float& z : depth.pixels) z = static_cast<float>(uniform(rng, 0.0, 6.5));
  EXPECT_EQ(result_of(depth, camera).at("status"), "no_table");
}

TEST_F(PlaceOddInputTest, OnePixel) {
  const Camera camera{500, 500, 0, 0, 1, 1, 1.0};
  EXPECT_EQ(result_of(DepthImage(1, 1, 0.7F), camera).at("status"), "no_table");
}

TEST_F(PlaceOddInputTest, OneRow) {
  const Camera camera{500, 500, 319.5, 0, 640, 1, 1.0};
  EXPECT_EQ(result_of(DepthImage(640, 1, 0.7F), camera).at("status"), "no_table");
}

TEST_F(PlaceOddInputTest, ExtremeCameras) {
  // Fields of view that no lens has; nothing to find, nothing to trip over.
  const Camera camera = small_camera();
  for (const double focal_length : {1e-12, 1e-3, 1e12, 1e300}) {
    SCOPED_TRACE(focal_length);
    Camera odd = camera;
    odd.fx = odd.fy = focal_length;
    result_of(DepthImage(camera.width, camera.height, 0.7F), odd);
    odd = camera;
    odd.cx = -focal_length;
    result_of(DepthImage(camera.width, camera.height, 0.7F), odd);
  }
}

TEST_F(PlaceOddInputTest, ImageOfTwelveMegapixels) {
  const Camera camera{3500, 3500, 2047.5, 1535.5, 4096, 3072, 0.1};
  const TestScan scan = scan_of(two_blocks(), camera);
  EXPECT_EQ(result_of(scan.depth, scan.camera).at("objects").size(), 2u);
}

TEST_F(PlaceOddInputTest, ObjectsCutByTheImagesBorder) {
  Camera camera = small_camera();
  camera.cx += 130;  // the blocks move to the right border
  Rng rng = make_rng(7);
  const TestScan seen = scan_of(two_blocks(), small_camera());
  Scanner scanner(two_blocks().objects);
  scanner.set_poses(two_blocks().T_world_object);
  DepthImage depth = scanner.render(camera, seen.T_world_camera).depth;
  for (float& z : depth.pixels) z = static_cast<float>(z > 0 ? z + normal(rng, 1.7e-3 * z * z) : 0.0);
  const json result = result_of(depth, camera);
  EXPECT_EQ(result.at("status"), "ok");
  EXPECT_GE(result.at("objects").size(), 1u);
}

TEST_F(PlaceOddInputTest, TableCoveredByOneBox) {
  // A box that fills the image: its top is the one plane there is.
  const Scene scene{{make_box("lid", {1.5, 1.5, 0.1})}, {make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.05})}};
  const TestScan scan = scan_of(scene, small_camera());
  EXPECT_EQ(result_of(scan.depth, scan.camera).at("status"), "no_object");
}

TEST_F(PlaceOddInputTest, MaskOfNoiseAndMaskOfEverything) {
  const TestScan scan = scan_of(two_blocks(), small_camera());
  LabelImage mask(scan.camera.width, scan.camera.height);
  Rng rng = make_rng(5);
  for (std::uint8_t& label : mask.pixels) label = static_cast<std::uint8_t>(uniform_int(rng, 0, 255));
  write_labels(mask, file("noise.png"));
  result_of(scan.depth, scan.camera, {"--mask", file("noise.png")});
  std::fill(mask.pixels.begin(), mask.pixels.end(), std::uint8_t{255});
  write_labels(mask, file("all.png"));
  result_of(scan.depth, scan.camera, {"--mask", file("all.png")});
  std::fill(mask.pixels.begin(), mask.pixels.end(), std::uint8_t{0});
  write_labels(mask, file("none.png"));
  EXPECT_EQ(result_of(scan.depth, scan.camera, {"--mask", file("none.png")}).at("status"), "no_object");
}

}  // namespace
}  // namespace dofusion
