#include "diffusion/schedule.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>

namespace dofusion {
namespace {

TEST(Schedule, DiscreteScalesGrowGeometrically) {
  const ModelConfig config = make_config(Preset::kPaper);
  const std::vector<double> sigmas = discrete_schedule(config);
  ASSERT_EQ(sigmas.size(), static_cast<std::size_t>(config.schedule_steps));
  EXPECT_NEAR(sigmas.front(), config.sigma_min, 1e-12);
  EXPECT_NEAR(sigmas.back(), config.sigma_max, 1e-12);
  for (std::size_t i = 2; i < sigmas.size(); ++i) EXPECT_NEAR(sigmas[i] / sigmas[i - 1], sigmas[1] / sigmas[0], 1e-9);
}

TEST(Schedule, TrainingDrawsAreLogUniform) {
  const ModelConfig config;
  Rng rng = make_rng(1);
  double sum = 0.0, squares = 0.0;
  const int count = 20000;
  for (int i = 0; i < count; ++i) {
    const double sigma = draw_sigma(config, rng);
    ASSERT_GE(sigma, config.sigma_min);
    ASSERT_LE(sigma, config.sigma_max);
    const double u = std::log(sigma / config.sigma_min) / std::log(config.sigma_max / config.sigma_min);
    sum += u;
    squares += u * u;
  }
  // Moments of a uniform variable, within about five standard errors.
  EXPECT_NEAR(sum / count, 1.0 / 2, 0.01);
  EXPECT_NEAR(squares / count, 1.0 / 3, 0.01);
}

TEST(Schedule, PaperDrawsAreOfTheDiscreteScales) {
  const ModelConfig config = make_config(Preset::kPaper);
  const std::vector<double> sigmas = discrete_schedule(config);
  Rng rng = make_rng(1);
  for (int i = 0; i < 100; ++i) EXPECT_THAT(sigmas, testing::Contains(draw_sigma(config, rng)));
}

TEST(Schedule, SamplingFallsFromStartToMinimum) {
  const ModelConfig config;
  const std::vector<double> sigmas = sampling_schedule(config, 50, 3.0);
  ASSERT_EQ(sigmas.size(), 50u);
  EXPECT_NEAR(sigmas.front(), 3.0, 1e-12);
  EXPECT_NEAR(sigmas.back(), 0.005, 1e-12);
  EXPECT_TRUE(std::is_sorted(sigmas.rbegin(), sigmas.rend()));
  EXPECT_EQ(sampling_schedule(config, 1, 3.0), std::vector<double>{3.0});
}

TEST(Schedule, NonsenseIsRefused) {
  EXPECT_THROW(sampling_schedule({}, 0, 3.0), std::invalid_argument);
  EXPECT_THROW(sampling_schedule({}, 10, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
