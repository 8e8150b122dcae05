#include "perception/smooth_noise.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace dofusion {
namespace {

struct Moments {
  double mean = 0.0, square = 0.0, beside = 0.0;  // of pixels, and of pixels with those one length to the right
  double independent = 0.0;                       // about as many independent values
};

Moments moments(double length_px) {
  constexpr int kWidth = 320, kHeight = 240, kImages = 40;
  const int lag = std::max(1, static_cast<int>(length_px));
  Rng rng = make_rng(21);
  Moments m;
  double n = 0.0;
  for (int image = 0; image < kImages; ++image) {
    const Image<float> noise = smooth_noise(kWidth, kHeight, length_px, rng);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u + lag < kWidth; ++u) {
        const double value = noise.at(v, u);
        m.mean += value;
        m.square += value * value;
        m.beside += value * noise.at(v, u + lag);
        n += 1.0;
      }
    }
  }
  m.mean /= n, m.square /= n, m.beside /= n;
  m.independent = n / std::max(1.0, 4.0 * 3.1416 * length_px * length_px);  // the correlation's area
  return m;
}

TEST(SmoothNoise, HasUnitVarianceAndTheCorrelationOfABlur) {
  for (const double length : {0.0, 1.0, 3.0, 10.0}) {
    const Moments m = moments(length);
    EXPECT_NEAR(m.mean, 0.0, 5.0 / std::sqrt(m.independent)) << length;
    // Up to two per cent by the interpolation between coarse nodes.
    EXPECT_NEAR(m.square, 1.0, 5.0 * std::sqrt(2.0 / m.independent) + 0.02) << length;
    const double expected = length > 0.0 ? std::exp(-0.25) : 0.0;  // exp(-(r / 2 L)^2) at r = L
    EXPECT_NEAR(m.beside, expected, 5.0 * std::sqrt(2.0 / m.independent) + 0.02) << length;
  }
}

TEST(SmoothNoise, WorksForImagesOfAnySizeAndAnyLength) {
  Rng rng = make_rng(1);
  for (const double length : {0.0, 0.3, 1.0, 50.0, 1e4}) {
    for (const int width : {1, 2, 7}) {
      const Image<float> noise = smooth_noise(width, 1, length, rng);
      ASSERT_EQ(noise.width, width);
      for (const float value : noise.pixels) EXPECT_TRUE(std::isfinite(value));
    }
  }
  EXPECT_THROW(smooth_noise(4, 4, -1.0, rng), std::invalid_argument);
  EXPECT_THROW(smooth_noise(4, 4, std::nan(""), rng), std::invalid_argument);
}

TEST(SmoothNoise, SeedRepeatsTheField) {
  Rng a = make_rng(3), b = make_rng(3);
  EXPECT_EQ(smooth_noise(40, 30, 5.0, a).pixels, smooth_noise(40, 30, 5.0, b).pixels);
}

TEST(NormalExceedance, InvertsTheTail) {
  EXPECT_NEAR(normal_exceedance(0.5), 0.0, 1e-12);
  EXPECT_NEAR(normal_exceedance(0.15865525393145707), 1.0, 1e-9);  // 1 - Phi(1)
  EXPECT_NEAR(normal_exceedance(0.9772498680518208), -2.0, 1e-9);
  EXPECT_EQ(normal_exceedance(0.0), std::numeric_limits<double>::infinity());
  EXPECT_EQ(normal_exceedance(2.0), -std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace dofusion
