#include "stability/metrics.h"

#include <gtest/gtest.h>

namespace dofusion {
namespace {

TEST(Displacement, IsTheLargestOverObjectsByDiameterAndAngle) {
  const std::vector<ObjectPtr> objects = {make_box("small", {0.03, 0.04, 0.12}), make_box("large", {0.3, 0.4, 1.2})};
  const std::vector<Pose> before(2, Pose::Identity());
  std::vector<Pose> after = before;
  after[0].translation() = Eigen::Vector3d(0.013, 0, 0);  // a tenth of its diameter of 0.13
  after[1].translation() = Eigen::Vector3d(0.013, 0, 0);  // a hundredth of its own
  after[1].linear() = so3_exp({0, 0.5, 0});
  const Displacement d = displacement(objects, before, after);
  EXPECT_NEAR(d.translation_pct, 10.0, 1e-9);
  EXPECT_NEAR(d.rotation_deg, 0.5 * 180 / M_PI, 1e-9);
  EXPECT_THROW(displacement(objects, before, {}), std::invalid_argument);
}

TEST(IsStable, NeedsBothBelowTen) {
  EXPECT_TRUE(is_stable({9.9, 9.9}));
  EXPECT_FALSE(is_stable({10.1, 0.0}));
  EXPECT_FALSE(is_stable({0.0, 10.1}));
}

TEST(Median, OfOddEvenAndEmpty) {
  EXPECT_EQ(median({3, 1, 2}), 2);
  EXPECT_EQ(median({4, 1, 2, 3}), 2.5);
  EXPECT_TRUE(std::isnan(median({})));
}

TEST(Bootstrap, CoversTheMeanOfAGaussian) {
  Rng rng = make_rng(10);
  std::vector<double> values;
  for (int i = 0; i < 400; ++i) values.push_back(normal(rng));
  const Interval interval = bootstrap_mean(values, rng);
  // 95 % of 400 standard normals: a mean within about 1.96 / 20 either way.
  EXPECT_NEAR(interval.high - interval.low, 2 * 1.96 / 20, 0.04);
  EXPECT_LT(interval.low, interval.high);
}

}  // namespace
}  // namespace dofusion
