#include "perception/sensor_noise.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/perception/plane_scans.h"

namespace dofusion {
namespace {

Errors plane_errors(SensorModel sensor, double scale, double depth) {
  const Scan scan = plane_scan(depth);
  Rng rng = make_rng(7);
  return errors(apply_sensor_noise(scan, kCamera, sensor, scale, rng), scan);
}

// A standard deviation from n draws is known to 1 / sqrt(2 n) of itself, a mean to sigma / sqrt(n): five times that.
constexpr double kSigmaTolerance = 5.0 / 283.0;  // sqrt(2 * 40000) = 283
constexpr double kMeanTolerance = 5.0 / 200.0;   // sqrt(40000) = 200

TEST(SensorNoise, RealsenseFollowsIntelsFormula) {
  EXPECT_NEAR(realsense_sigma(0.7, 0.0), 0.00185, 0.5e-5);  // as the tuning guide's calculation gives
  for (const double depth : {0.4, 0.7, 1.5}) {
    const double expected = depth * depth * 0.08 / (424.0 * 0.05);
    const Errors e = plane_errors(SensorModel::kRealsense, 1.0, depth);
    EXPECT_NEAR(e.sigma / expected, 1.0, kSigmaTolerance) << depth;
    EXPECT_NEAR(e.mean / expected, 0.0, kMeanTolerance) << depth;
    EXPECT_EQ(e.missing, 0) << depth;
  }
}

TEST(SensorNoise, ScaleMultipliesTheSigma) {
  for (const double scale : {0.5, 2.0, 4.0}) {
    const Errors e = plane_errors(SensorModel::kRealsense, scale, 0.7);
    EXPECT_NEAR(e.sigma / (scale * realsense_sigma(0.7, 0.0)), 1.0, kSigmaTolerance) << scale;
  }
}

TEST(SensorNoise, NoneAndScaleZeroAreExact) {
  const Scan scan = step_scan(0.5, 0.9);
  for (const std::string& name : sensor_names()) {
    Rng rng = make_rng(1);
    EXPECT_EQ(apply_sensor_noise(scan, kCamera, sensor_from_string(name), 0.0, rng).pixels, scan.depth.pixels) << name;
  }
  Rng rng = make_rng(1);
  EXPECT_EQ(apply_sensor_noise(scan, kCamera, SensorModel::kNone, 3.0, rng).pixels, scan.depth.pixels);
}

TEST(SensorNoise, SeedRepeatsTheImage) {
  const Scan scan = step_scan(0.5, 0.9);
  for (const std::string& name : sensor_names()) {
    if (name == "none") continue;
    Rng a = make_rng(3), b = make_rng(3), c = make_rng(4);
    const SensorModel sensor = sensor_from_string(name);
    const DepthImage first = apply_sensor_noise(scan, kCamera, sensor, 1.0, a);
    EXPECT_EQ(first.pixels, apply_sensor_noise(scan, kCamera, sensor, 1.0, b).pixels) << name;
    EXPECT_NE(first.pixels, apply_sensor_noise(scan, kCamera, sensor, 1.0, c).pixels) << name;
  }
}

TEST(SensorNoise, PublishedFormulasGiveTheirNumbers) {
  // Worked out by hand from the formulas, in metres.
  EXPECT_NEAR(kinect_axial_sigma(1.4, 0.0), 0.0012 + 0.0019, 1e-12);
  EXPECT_NEAR(kinect_axial_sigma(1.0, 75 * kDegree), 0.0012 + 0.0019 * 0.36 + 0.0001 * 25.0, 1e-12);  // (75/15)^2
  EXPECT_NEAR(kinect_lateral_sigma_px(45 * kDegree), 0.835, 1e-12);
  EXPECT_NEAR(kinect_lateral_sigma_px(0.0), 0.8, 1e-12);
  EXPECT_NEAR(kinect2_axial_sigma(1.0, 0.0), 0.0013, 1e-12);
  EXPECT_NEAR(kinect2_axial_sigma(1.0, 45 * kDegree), 0.0014, 1e-12);
  EXPECT_NEAR(azure_sigma(0.4, 0.0), 0.0005, 1e-12);
  EXPECT_NEAR(azure_sigma(1.5, 0.0), 0.0015, 1e-12);
}

TEST(SensorNoise, DisparityStepsAreAnEighthOfAPixel) {
  const double focal_baseline = 585.5 * 0.075;
  for (const double depth : {0.5, 1.0, 3.0}) {
    const double quantised = quantise_disparity(depth, 0.125);
    const double steps = focal_baseline / quantised / 0.125;
    EXPECT_NEAR(steps, std::round(steps), 1e-9);
    EXPECT_LE(std::abs(focal_baseline / quantised - focal_baseline / depth), 0.0625 + 1e-12);
    EXPECT_NEAR(quantise_disparity(quantised, 0.125), quantised, 1e-12);
  }
  // At 1 m a step is z^2 / (f B) / 8 = 2.85 mm: Khoshelham and Elberink's 2.85e-3 z^2.
  EXPECT_NEAR(1.0 / focal_baseline / 8.0, 2.85e-3, 0.5e-5);
  EXPECT_EQ(quantise_disparity(1e6, 0.125), 0.0);
}

TEST(SensorNoise, KhoshelhamsStepIsAnEighthOfAPixelAndHisSigmaHalfAStep) {
  for (const double depth : {0.5, 1.0, 3.0}) {
    EXPECT_NEAR(khoshelham_depth_step(depth), depth * depth / (585.5 * 0.075) / 8.0,
                0.002 * khoshelham_depth_step(depth));
    EXPECT_NEAR(khoshelham_sigma(depth, 1.0), 1.425e-3 * depth * depth, 1e-15);
    EXPECT_NEAR(khoshelham_sigma(depth, 0.0), 0.5 * khoshelham_depth_step(depth), 1e-15);
  }
}

TEST(SensorNoise, KinectReadingsLieOnDisparitySteps) {
  const double focal_baseline = 585.5 * 0.075;
  const Scan scan = plane_scan(1.0);
  for (const SensorTerms& terms : {sensor_terms(SensorModel::kKinect), published_kinect_terms()}) {
    Rng rng = make_rng(8);
    for (const float z : apply_sensor_noise(scan, kCamera, terms, 1.0, rng).pixels) {
      const double steps = focal_baseline / z * 8.0;
      EXPECT_NEAR(steps, std::round(steps), 1e-4);  // a float's rounding of 350 steps
    }
  }
}

TEST(SensorNoise, QuantisationAddsATwelfthOfASquaredStep) {
  const double depth = 1.0, step = depth * depth / (585.5 * 0.075) / 8.0;
  // The sigma is two thirds of the step, so that the rounding error is nearly uniform and independent: step^2 / 12.
  const double expected = std::hypot(kinect_axial_sigma(depth, 0.0), step / std::sqrt(12.0));
  const Scan scan = plane_scan(depth);
  Rng rng = make_rng(8);
  const DepthImage noisy = apply_sensor_noise(scan, kCamera, published_kinect_terms(), 1.0, rng);
  EXPECT_NEAR(errors(noisy, scan).sigma / expected, 1.0, kSigmaTolerance + 0.01);
}

// Mean and mean square of the errors in units of sigma(z, incidence), a pixel's own each.
Errors normalised(const DepthImage& noisy, const Scan& scan, double (*sigma)(double z, double incidence)) {
  Errors e;
  double sum = 0.0, squares = 0.0;
  for (int v = 0; v < 200; ++v)
    for (int u = 0; u < 200; ++u) {
      const double z = scan.depth.at(v, u);
      const double error = (noisy.at(v, u) - z) / sigma(z, incidence_angle(scan, kCamera, v, u));
      sum += error / kPixels;
      squares += error * error / kPixels;
    }
  e.mean = sum;
  e.sigma = std::sqrt(squares);
  return e;
}

TEST(SensorNoise, AxialNoiseFollowsEveryFormulaOverDepthAndIncidence) {
  using Sigma = double (*)(double, double);
  Rng rng = make_rng(14);
  for (const Sigma sigma : {Sigma{kinect_axial_sigma}, Sigma{khoshelham_sigma}, Sigma{kinect2_axial_sigma},
                            Sigma{realsense_sigma}, Sigma{azure_sigma}}) {
    for (const double depth : {0.6, 1.0, 2.0}) {
      for (const double tilt_deg : {0.0, 45.0, 70.0}) {
        const Scan scan = plane_scan(depth, tilt_deg * kDegree);
        SensorTerms terms;
        terms.axial_sigma = sigma;
        const Errors e = normalised(apply_sensor_noise(scan, kCamera, terms, 1.0, rng), scan, sigma);
        EXPECT_NEAR(e.mean, 0.0, kMeanTolerance) << depth << ", " << tilt_deg;
        EXPECT_NEAR(e.sigma, 1.0, kSigmaTolerance) << depth << ", " << tilt_deg;
      }
    }
  }
}

TEST(SensorNoise, LateralShiftShowsOnASlope) {
  // The plane z (cos t + sin t x) = cos t, x = (u - cx) / f, has the slope dz/du = -z^2 tan t / f.
  const double tilt = 60 * kDegree;
  const Scan scan = plane_scan(1.0, tilt);
  using Sigma = double (*)(double);
  for (const Sigma sigma_px :
       {Sigma{kinect_lateral_sigma_px}, Sigma{handa_lateral_sigma_px}, Sigma{azure_lateral_sigma_px}}) {
    SensorTerms terms;
    terms.lateral_sigma_px = sigma_px;
    Rng rng = make_rng(9);
    const DepthImage noisy = apply_sensor_noise(scan, kCamera, terms, 1.0, rng);
    double sum = 0.0;
    int n = 0;
    for (int v = 5; v < 195; ++v)
      for (int u = 5; u < 195; ++u) {
        const double z = scan.depth.at(v, u);
        const double slope = z * z * std::tan(tilt) / kCamera.fx;
        const double error = (noisy.at(v, u) - z) / (slope * sigma_px(incidence_angle(scan, kCamera, v, u)));
        sum += error * error;
        ++n;
      }
    // Chi-squared; its mean of 1 is known to sqrt(2 / n), and the slope's own change over a pixel is under a per cent.
    EXPECT_NEAR(sum / n, 1.0, 5.0 * std::sqrt(2.0 / n) + 0.01);
  }
}

TEST(SensorNoise, CorrelatedNoiseKeepsItsSigma) {
  SensorTerms terms;
  terms.axial_sigma = realsense_sigma;
  terms.correlation_px = 2.0;
  const Scan scan = plane_scan(0.7);
  Rng rng = make_rng(15);
  double squares = 0.0, neighbours = 0.0;
  constexpr int kImages = 20;
  for (int image = 0; image < kImages; ++image) {
    const DepthImage noisy = apply_sensor_noise(scan, kCamera, terms, 1.0, rng);
    for (int v = 0; v < 200; ++v)
      for (int u = 0; u + 2 < 200; ++u) {
        const auto error = [&](int column) {
          return (static_cast<double>(noisy.at(v, column)) - scan.depth.at(v, column)) / realsense_sigma(0.7, 0.0);
        };
        squares += error(u) * error(u) / (kImages * 200 * 198);
        neighbours += error(u) * error(u + 2) / (kImages * 200 * 198);
      }
  }
  // Squares are correlated over an area of 2 pi 2^2 = 25 pixels: as good as 32,000 independent ones.
  EXPECT_NEAR(squares, 1.0, 5.0 * std::sqrt(2.0 / 32000.0));
  EXPECT_NEAR(neighbours, std::exp(-0.25), 5.0 * std::sqrt(2.0 / 32000.0));
}

TEST(SensorNoise, WarpIsAnErrorOfTheDisparity) {
  EXPECT_EQ(shift_disparity(1.0, 0.0), 1.0);
  EXPECT_NEAR(585.5 * 0.075 / shift_disparity(2.0, 0.3), 585.5 * 0.075 / 2.0 + 0.3, 1e-9);
  EXPECT_EQ(shift_disparity(2.0, -30.0), 0.0);  // 22 pixels were all there is
  const Scan scan = plane_scan(1.0);
  SensorTerms terms;
  terms.warp_px = 0.1;
  terms.warp_length_px = 5.0;
  Rng rng = make_rng(16);
  double squares = 0.0, bend = 0.0;
  constexpr int kImages = 20;
  for (int image = 0; image < kImages; ++image) {
    const DepthImage warped = apply_sensor_noise(scan, kCamera, terms, 1.0, rng);
    for (int v = 0; v < 200; ++v)
      for (int u = 0; u + 1 < 200; ++u) {
        const double error = 585.5 * 0.075 * (1.0 / warped.at(v, u) - 1.0);
        const double next = 585.5 * 0.075 * (1.0 / warped.at(v, u + 1) - 1.0);
        squares += error * error / (kImages * 200 * 199);
        bend += (next - error) * (next - error) / (kImages * 200 * 199);
      }
  }
  // Squares are correlated over 2 pi 5^2 = 157 pixels.
  EXPECT_NEAR(squares / 0.01, 1.0, 5.0 * std::sqrt(2.0 / 5000.0));
  EXPECT_LT(bend / squares, 0.03);  // 2 (1 - exp(-1 / 100)) = 0.02: neighbours differ little
}

TEST(SensorNoise, NothingHitStaysNothing) {
  Scan scan = plane_scan(1.0);
  for (int u = 0; u < 200; ++u) scan.depth.at(10, u) = 0.0f;
  for (const std::string& name : sensor_names()) {
    Rng rng = make_rng(13);
    const DepthImage noisy = apply_sensor_noise(scan, kCamera, sensor_from_string(name), 1.0, rng);
    for (int u = 0; u < 200; ++u) EXPECT_EQ(noisy.at(10, u), 0.0f) << name;
  }
}

TEST(SensorNoise, CallersMistakesThrow) {
  const Scan scan = plane_scan(1.0);
  Rng rng = make_rng(1);
  EXPECT_THROW(sensor_from_string("lidar"), std::invalid_argument);
  EXPECT_THROW(apply_sensor_noise(scan, kCamera, SensorModel::kKinect, -1.0, rng), std::invalid_argument);
  EXPECT_THROW(apply_sensor_noise(Scan{}, kCamera, SensorModel::kKinect, 1.0, rng), std::invalid_argument);
  for (const std::string& name : sensor_names()) EXPECT_EQ(to_string(sensor_from_string(name)), name);
}

}  // namespace
}  // namespace dofusion
