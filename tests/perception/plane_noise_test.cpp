// The measurement of a table's noise, and the Kinect model against what it gave on real frames.
#include "perception/plane_noise.h"

#include <cmath>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "perception/depth_io.h"
#include "perception/sensor_noise.h"

namespace dofusion {
namespace {

constexpr double kPi = 3.14159265358979323846;
const std::filesystem::path kFrames = std::filesystem::path(DOFUSION_REAL_DIR) / "mosd";
const Camera kCamera{525.0, 525.0, 319.5, 239.5, 640, 480, 1.0};  // that of the real frames

Scan table_scan(double incidence_deg, double distance) {
  const double elevation = (90.0 - incidence_deg) * kPi / 180.0;
  const Pose T_world_camera =
      look_at(distance * Eigen::Vector3d(std::cos(elevation), 0.0, std::sin(elevation)), Eigen::Vector3d::Zero());
  return Scanner({}).render(kCamera, T_world_camera);
}

std::vector<NoiseBin> reference_bins() {
  std::vector<double> distances;
  for (const TableNoise& row : kKinectTableNoise) distances.push_back(row.distance);
  return noise_bins(distances);
}

TEST(PlaneNoise, MeasuresIndependentNoiseExactly) {
  std::vector<NoiseBin> bins = reference_bins();
  const Scan scan = table_scan(50.0, 0.85);
  Rng rng = make_rng(1);
  DepthImage noisy = scan.depth;
  for (float& z : noisy.pixels) z += static_cast<float>(normal(rng, 0.001));
  add_plane_noise(noisy, scan.labels, bins);
  for (const NoiseBin& bin : bins) {
    ASSERT_GT(bin.pixels, 5000u) << bin.distance;
    EXPECT_NEAR(bin.sigma(), 0.001, 0.001 * 5.0 / std::sqrt(2.0 * bin.pixels) + 1e-5) << bin.distance;
  }
}

TEST(PlaneNoise, APlaneHasNone) {
  std::vector<NoiseBin> bins = reference_bins();
  const Scan scan = table_scan(50.0, 0.85);
  add_plane_noise(scan.depth, scan.labels, bins);
  for (const NoiseBin& bin : bins) EXPECT_LT(bin.sigma(), 1.1e-4) << bin.distance;  // the perspective's curvature
}

TEST(PlaneNoise, LeavesOutWhatIsNotTable) {
  std::vector<NoiseBin> bins = noise_bins({0.7});
  DepthImage depth(40, 40, 0.7F);
  LabelImage labels(40, 40, kLabelTable);
  depth.at(20, 20) = 0.9F;
  labels.at(20, 20) = kLabelFirstObject;
  add_plane_noise(depth, labels, bins);
  EXPECT_EQ(bins[0].sigma(), 0.0);
  EXPECT_EQ(bins[0].pixels % 121, 0u);
  EXPECT_THROW(add_plane_noise(DepthImage(3, 3), labels, bins), std::invalid_argument);
}

TEST(KinectCalibration, ScattersOnATableAsTheRealFramesDo) {
  std::vector<NoiseBin> bins = reference_bins();
  for (int k = 0; k < 8; ++k) {  // the real tables were seen at 46 to 56 degrees
    const Scan scan = table_scan(46.0 + 10.0 * k / 7.0, 0.85);
    Rng rng = make_rng(77, k);
    DepthImage noisy = apply_sensor_noise(scan, kCamera, SensorModel::kKinect, 1.0, rng);
    for (float& z : noisy.pixels) z = std::round(1000.0F * z) / 1000.0F;  // as the frames are stored
    add_plane_noise(noisy, scan.labels, bins);
  }
  for (std::size_t k = 0; k < bins.size(); ++k) {
    EXPECT_NEAR(bins[k].sigma() / kKinectTableNoise[k].sigma, 1.0, 0.15) << bins[k].distance;
  }
}

TEST(KinectCalibration, TheMeasurementGivesTheReferenceOnRealFrames) {
  if (!std::filesystem::exists(kFrames / "camera.json"))
    GTEST_SKIP() << "no real frames in " << kFrames << " (PointCloudLibrary/data, segmentation/mOSD)";
  const Camera camera = read_camera(kFrames / "camera.json");
  std::vector<NoiseBin> bins = reference_bins();
  for (int n = 0; n < 45; ++n) {
    const std::string stem = (kFrames / ("learn" + std::to_string(n))).string();
    add_plane_noise(read_depth(stem + "_depth.png", camera), read_labels(stem + "_label.png", camera), bins);
  }
  for (std::size_t k = 0; k < bins.size(); ++k) {
    EXPECT_NEAR(bins[k].sigma() / kKinectTableNoise[k].sigma, 1.0, 0.03) << bins[k].distance;
  }
}

}  // namespace
}  // namespace dofusion
