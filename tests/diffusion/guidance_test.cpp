// Costs against hand calculations and finite differences.
#include "diffusion/guidance.h"

#include <cmath>

#include <gtest/gtest.h>

namespace dofusion {
namespace {

using Eigen::Vector3d;

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

Scene one_cube() { return {{make_block("cube")}, {at(0, 0, 0.025)}}; }

// Half the sum of squares changes along a twist as the terms' gradients say.
void expect_gradient_agrees(const PoseCostPtr& cost, const Pose& pose, double step, double tolerance) {
  std::vector<CostTerm> terms;
  cost->add_terms(pose, terms);
  ASSERT_FALSE(terms.empty());
  Vector6 gradient = Vector6::Zero();
  for (const CostTerm& term : terms) gradient += term.value * term.gradient;
  for (int i = 0; i < 6; ++i) {
    Vector6 twist = Vector6::Zero();
    twist[i] = step;
    const double numeric =
        (cost_of({cost}, add_world_noise(pose, twist)) - cost_of({cost}, add_world_noise(pose, -twist))) / (2 * step);
    EXPECT_NEAR(gradient[i], numeric, tolerance * gradient.norm()) << i;
  }
}

TEST(Guidance, GradientsAgreeWithFiniteDifferences) {
  const Pose tilted = make_pose(so3_exp({0.2, -0.3, 0.4}), {0.3, -0.2, 0.05});
  expect_gradient_agrees(within_region({-0.1, -0.1}, {0.1, 0.1}), tilted, 1e-5, 1e-6);
  expect_gradient_agrees(upright(Vector3d::UnitX(), 0.1), tilted, 1e-5, 1e-4);
  // Points in two objects at once and points that come free between the two poses are left out of the derivative.
  const Pose inside = make_pose(so3_exp({0.1, 0.2, 0.3}), {0.02, 0.01, 0.06});
  expect_gradient_agrees(no_penetration(one_cube(), *make_block("cube"), 1e-3, 2000), inside, 1e-5, 0.02);
}

TEST(Guidance, NothingIsAskedWhereEverythingIsFine) {
  const Scene scene = one_cube();
  const ObjectPtr query = make_block("cube");
  EXPECT_EQ(cost_of({no_penetration(scene, *query)}, at(0, 0, 0.0751)), 0.0);
  EXPECT_EQ(cost_of({within_region({-0.1, -0.1}, {0.1, 0.1})}, at(0.05, -0.05, 3)), 0.0);
  EXPECT_EQ(cost_of({upright(Vector3d::UnitZ(), 0.1)}, make_pose(so3_exp({0.05, 0, 2}), {0, 0, 0})), 0.0);
  const Pose pose = at(0.05, 0.02, 0.2);
  EXPECT_EQ(guided({no_penetration(scene, *query)}, pose, 0.1, 0.1).matrix(), pose.matrix());
}

// A cube sunk 4 mm into another one under it comes free, upwards, when little holds it where it is.
TEST(Guidance, ASunkCubeComesFreeUpwards) {
  const Scene scene = one_cube();
  const ObjectPtr query = make_block("cube");
  const Pose freed = guided({no_penetration(scene, *query)}, at(0.003, 0, 0.071), 0.01, 0.1);
  EXPECT_NEAR(freed.translation().z(), 0.075, 1e-4);
  EXPECT_LT(rotation_angle(freed.linear()), 0.01);
  // The table counts as well.
  EXPECT_NEAR(guided({no_penetration({}, *query)}, at(0, 0, 0.02), 0.01, 0.1).translation().z(), 0.025, 1e-4);
}

// Of one linear term the minimum is known: sigma^2 and tolerance^2 share the way between them.
TEST(Guidance, BeliefAndWishShareTheWay) {
  const PoseCostPtr region = within_region({-0.1, -1}, {0.1, 1}, 0.02);
  const Pose pose = guided({region}, at(0.2, 0, 0), 0.01, 0.1);
  EXPECT_NEAR(pose.translation().x(), 0.2 - 0.1 * 0.01 * 0.01 / (0.01 * 0.01 + 0.02 * 0.02), 1e-9);
}

TEST(Guidance, AFallenAxisRises) {
  const Pose lying = make_pose(so3_exp({1.2, 0, 0}), {0, 0, 0});
  const Pose raised = guided({upright(Vector3d::UnitZ(), 0.0, 0.01)}, lying, 0.1, 10.0);
  EXPECT_LT(std::acos((raised.linear() * Vector3d::UnitZ()).z()), 0.01);
  // Even from upside down, where every way is as good.
  const Pose over = make_pose(so3_exp({M_PI, 0, 0}), {0, 0, 0});
  EXPECT_LT(
      std::acos((guided({upright(Vector3d::UnitZ(), 0.0, 0.01)}, over, 0.1, 10.0).linear() * Vector3d::UnitZ()).z()),
      0.1);
}

TEST(Guidance, PlanesHoldTheOriginAbove) {
  const PoseCostPtr above = within_planes({{Vector3d::UnitZ(), 0.1}, {Vector3d::UnitX(), -1.0}}, 0.02);
  EXPECT_EQ(cost_of({above}, at(0, 0, 0.11)), 0.0);
  expect_gradient_agrees(above, at(0.3, 0.1, 0.05), 1e-5, 1e-6);
  const Pose raised = guided({above}, at(0, 0, 0.05), 0.02, 0.1);
  EXPECT_NEAR(raised.translation().z(), 0.05 + 0.05 / 2.0, 1e-9);  // belief and tolerance are the same
}

TEST(Guidance, ClearanceIsKeptFromObjectsAndNotFromTheTable) {
  const ObjectPtr query = make_block("cube");
  const PoseCostPtr clear = keep_clear(one_cube(), *query, 0.03, 0.001);
  EXPECT_EQ(cost_of({clear}, at(0.0801, 0, 0.025)), 0.0);
  EXPECT_EQ(cost_of({keep_clear({}, *query, 0.03)}, at(0, 0, 0.025)), 0.0);
  EXPECT_NEAR(guided({clear}, at(0.07, 0, 0.025), 0.1, 0.001).translation().x(), 0.08, 5e-4);
}

TEST(Guidance, BadWishesAreRefused) {
  EXPECT_THROW(within_planes({{Vector3d(0, 0, 2), 0.0}}), std::invalid_argument);
  EXPECT_THROW(keep_clear({}, *make_block("cube"), -1.0), std::invalid_argument);
  EXPECT_THROW(within_region({1, 0}, {0, 0}), std::invalid_argument);
  EXPECT_THROW(upright(Vector3d::Zero()), std::invalid_argument);
  EXPECT_THROW(no_penetration({}, *make_block("cube"), 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
