// Wishes as tests of placements and as costs.
#include "apps/wishes.h"

#include <cmath>

#include <gtest/gtest.h>

#include "stability/files.h"
#include "tests/perception/box_image.h"

namespace dofusion {
namespace {

using Names = std::vector<std::string>;

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

// Two cubes 20 cm apart on the table, seen from +x.
WishScene two_cubes() {
  const ObjectPtr cube = make_block("cube");
  return {{{cube, cube}, {at(0, -0.1, 0.025), at(0, 0.1, 0.025)}}, cube, test_camera(), look_at({0.5, 0.0, 0.4}, {0, 0, 0})};
}

Placement settled_at(const WishScene& scene, const Pose& pose) {
  PlacementOptions options;
  options.polish = false;
  options.trials = 0;
  return check_placements(scene.scene, scene.query, {pose}, options).front();
}

TEST(Wishes, ARegionHoldsTheQuerysCentre) {
  const WishScene scene = two_cubes();
  Wishes wishes;
  wishes.region = {-0.05, -0.05, 0.05, 0.05};
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0.04, 0, 0.025))), Names{});
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0.06, 0, 0.025))), Names{"region"});
  EXPECT_GT(cost_of(guides(wishes, scene), at(0.06, 0, 0.025)), 0.0);
  EXPECT_EQ(cost_of(guides(wishes, scene), at(0.04, 0, 0.025)), 0.0);
  EXPECT_EQ(wished_centre(wishes, scene)->norm(), 0.0);
}

TEST(Wishes, APartOfTheImageIsWhereTheCameraSeesTheQuery) {
  const WishScene scene = two_cubes();
  const Pose pose = at(0.05, 0.02, 0.025);
  const Eigen::Vector2d pixel = project(scene.camera, scene.T_world_camera.inverse() * pose.translation());
  Wishes wishes;
  const auto around = [&](double du, double dv) {
    return std::array<double, 4>{pixel.x() + du - 5, pixel.y() + dv - 5, pixel.x() + du + 5, pixel.y() + dv + 5};
  };
  wishes.image_region = around(0, 0);
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, pose)), Names{});
  EXPECT_EQ(cost_of(guides(wishes, scene), pose), 0.0);
  for (const auto& [du, dv] : {std::pair{12.0, 0.0}, {-12.0, 0.0}, {0.0, 12.0}, {0.0, -12.0}}) {
    wishes.image_region = around(du, dv);
    EXPECT_EQ(unmet(wishes, scene, settled_at(scene, pose)), Names{"image-region"}) << du << " " << dv;
    EXPECT_GT(cost_of(guides(wishes, scene), pose), 0.0);
  }
}

TEST(Wishes, OnAnObjectIsNotBesideItNorOnAnother) {
  const WishScene scene = two_cubes();
  Wishes wishes;
  set_on("1", wishes);
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0, 0.1, 0.075))), Names{});
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0, -0.1, 0.075))), Names{"on 1"});
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0, 0.15, 0.025))), Names{"on 1"});
  EXPECT_EQ(cost_of(guides(wishes, scene), at(0, 0.1, 0.075)), 0.0);
  EXPECT_GT(cost_of(guides(wishes, scene), at(0, 0.1, 0.025)), 0.0);
  EXPECT_THROW(check_wishes(wishes, 1), InputError);
  check_wishes(wishes, 2);
  Wishes table;
  set_on("table", table);
  EXPECT_EQ(unmet(table, scene, settled_at(scene, at(0, 0, 0.025))), Names{});
  EXPECT_EQ(unmet(table, scene, settled_at(scene, at(0, 0.1, 0.075))), Names{"on table"});
}

TEST(Wishes, ClearanceCountsFromWhatIsNotTouched) {
  const WishScene scene = two_cubes();
  Wishes wishes;
  wishes.clearance = 0.03;
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0, 0, 0.025))), Names{});                 // 50 mm to either
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0, 0.03, 0.025))), Names{"clearance"});   // 20 mm to one
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0, 0.1, 0.075))), Names{});               // it lies on one
  EXPECT_TRUE(guides(wishes, scene).empty());
  wishes.on_table = true;
  EXPECT_GT(cost_of(guides(wishes, scene), at(0, 0.03, 0.025)), 0.0);
}

TEST(Wishes, UprightIsToTenDegrees) {
  const WishScene scene = two_cubes();
  Wishes wishes;
  wishes.upright = axis_from_string("-x");
  const Pose up = make_pose(so3_exp({0, M_PI / 2.0, 0}), {0, 0, 0.025});  // x points down
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, up)), Names{});
  EXPECT_EQ(unmet(wishes, scene, settled_at(scene, at(0, 0, 0.025))), Names{"upright"});
  EXPECT_THROW(axis_from_string("up"), InputError);
}

TEST(Wishes, NonsenseIsRefused) {
  Wishes wishes;
  EXPECT_FALSE(wishes.any());
  for (const char* text : {"", "-1", "floor", "1.5", "1000"}) EXPECT_THROW(set_on(text, wishes), InputError) << text;
  wishes.region = {0.1, 0.0, 0.0, 0.1};
  EXPECT_THROW(check_wishes(wishes, 2), InputError);
  EXPECT_EQ(to_string(wishes), "--region 0.1 0 0 0.1");
}

}  // namespace
}  // namespace dofusion
