#include "perception/object_model.h"

#include <map>

#include <gtest/gtest.h>

#include "stability/shapes.h"

namespace dofusion {
namespace {

TEST(ObjectModel, FacesOfTheBlocks) {
  const std::map<std::string, std::pair<std::size_t, std::size_t>> faces = {{"cube", {6, 1}},
                                                                            {"rectangle", {6, 2}},
                                                                            {"half_rectangle", {6, 3}},
                                                                            {"tall_triangle", {5, 5}},
                                                                            {"middle_triangle", {5, 3}},
                                                                            {"tetrahedron", {5, 2}},
                                                                            {"hat", {5, 3}}};
  for (const auto& [name, count] : faces) {
    const ObjectModel model(make_block(name));
    EXPECT_EQ(model.faces.size(), count.first) << name;
    EXPECT_EQ(model.distinct.size(), count.second) << name;
    double area = 0.0;
    for (const PlanarFace& face : model.faces) area += face.area;
    EXPECT_NEAR(area, surface_area(model.object->mesh), 1e-12) << name;
  }
}

TEST(ObjectModel, RestsLieOnTheTable) {
  for (const ObjectPtr& object : all_blocks()) {
    const ObjectModel model(object);
    ASSERT_FALSE(model.resting.empty()) << object->name;
    for (const DistinctRest& rest : model.resting) {
      const Pose pose = make_pose(rest.pose.R_world_object, {0.0, 0.0, rest.pose.height});
      EXPECT_NEAR(lowest_point(model, pose), 0.0, 1e-9) << object->name;
    }
  }
  EXPECT_EQ(ObjectModel(make_block("cube")).resting.size(), 1u);
  EXPECT_NEAR(ObjectModel(make_block("cube")).resting[0].yaw_period, M_PI / 2.0, 1e-12);
}

// Two 50 mm cubes side by side: a gap, and an overlap, of 3 mm. Exact in double precision.
TEST(ObjectModel, ClearanceAndOverlapOfCubes) {
  const ObjectModel cube(make_block("cube"));
  const auto at = [](double x) { return make_pose(Eigen::Matrix3d::Identity(), {x, 0.0, 0.0}); };
  EXPECT_NEAR(clearance(cube, at(0.0), cube, at(0.053)), 0.003, 1e-9);
  EXPECT_EQ(overlap(cube, at(0.0), cube, at(0.053)), 0.0);
  EXPECT_NEAR(overlap(cube, at(0.0), cube, at(0.047)), 0.003, 1e-9);
  EXPECT_NEAR(clearance(cube, at(0.0), cube, at(0.047)), -0.003, 1e-9);
}

}  // namespace
}  // namespace dofusion
