// Scenes written as MJCF and read back.
#include <algorithm>

#include <gtest/gtest.h>

#include "stability/mjcf.h"
#include "stability/mjcf_scene.h"
#include "stability/outcome.h"
#include "stability/shape_families.h"
#include "stability/shapes.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

double lowest(const Object& object) { return bounding_box(object.mesh).min.z(); }

// All on the table, side by side.
Scene row_of(const std::vector<ObjectPtr>& objects) {
  Scene scene;
  scene.objects = objects;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    scene.T_world_object.push_back(at(0.15 * static_cast<double>(i), 0.02, -lowest(*objects[i])));
  }
  return scene;
}

// A few a scene: MuJoCo's memory grows with the square of the contacts that there might be.
std::vector<std::vector<ObjectPtr>> all_kinds() {
  Rng rng = make_rng(5);
  return {{make_block("cube"), make_cylinder("cylinder", 0.02, 0.06), draw_shape(ShapeFamilyKind::kBowl, rng)},
          {make_block("hat"), make_sphere("sphere", 0.02), draw_shape(ShapeFamilyKind::kMug, rng)},
          {make_block("tall_triangle"), draw_shape(ShapeFamilyKind::kEll, rng)}};
}

class RoundTrip : public testing::Test {
 protected:
  MjcfScene written(const Scene& scene) {
    write_mjcf(scene, directory_ / "scene");
    return MjcfScene(directory_ / "scene/scene.xml");
  }
  TemporaryDirectory directory_;
};

TEST_F(RoundTrip, PosesMassesAndDiametersComeBack) {
  for (const auto& objects : all_kinds()) {
    const Scene scene = row_of(objects);
    const MjcfScene file = written(scene);
    ASSERT_EQ(file.moving().size(), objects.size());
    const std::vector<Pose> poses = file.initial_poses();
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const auto index = static_cast<std::size_t>(file.moving()[i]);
      const SceneBody& body = file.bodies()[index];
      const Object& object = *objects[i];
      // Nine digits of metres in the text.
      EXPECT_TRUE(poses[index].isApprox(scene.T_world_object[i], 1e-8)) << object.name;
      EXPECT_NEAR(body.mass, 600.0 * object.volume, 1e-7 * body.mass) << object.name;
      // Corners are spheres of 0.01 mm, one at either end; MuJoCo's mesh vertices are single precision.
      EXPECT_NEAR(body.diameter, object.diameter, 2.1e-5) << object.name;
      EXPECT_GE(body.diameter, object.diameter * (1.0 - 1e-6)) << object.name;
    }
  }
}

TEST_F(RoundTrip, SettlingAgrees) {
  for (const auto& objects : all_kinds()) {
    Scene scene = row_of(objects);
    scene.T_world_object[0] = make_pose(so3_exp({0.5, 0.2, 0}), {0, 0, 0.07});  // falls
    const SettleResult here = Simulator(objects).settle(scene.T_world_object), there = written(scene).settle();
    EXPECT_EQ(here.status, there.status);
    EXPECT_EQ(here.touching, there.touching);
    EXPECT_NEAR(here.initial_penetration, there.initial_penetration, 1e-8);
    for (std::size_t i = 0; i < objects.size(); ++i) {
      // Poses and meshes are rounded to nine digits, and a fall makes more of the difference.
      const Displacement apart = displacement({objects[i]}, {here.T_world_object[i]}, {there.T_world_object[i]});
      EXPECT_LT(apart.translation_pct, 0.5) << objects[i]->name;
      EXPECT_LT(apart.rotation_deg, 0.5) << objects[i]->name;
    }
  }
}

TEST_F(RoundTrip, ObjectsComeBackAsWhatTheyWere) {
  for (const auto& objects : all_kinds()) {
    const Scene scene = row_of(objects), back = written(scene).to_scene();
    ASSERT_EQ(back.objects.size(), objects.size());
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const Object &was = *objects[i], &is = *back.objects[i];
      EXPECT_EQ(is.kind, was.kind) << was.name;
      EXPECT_EQ(is.convex, was.convex) << was.name;
      EXPECT_EQ(is.parts.size(), was.parts.size()) << was.name;
      // Parts and meshes in single precision.
      EXPECT_NEAR(is.volume, was.volume, 1e-5 * was.volume) << was.name;
      EXPECT_NEAR(is.diameter, was.diameter, 1e-5 * was.diameter) << was.name;
      EXPECT_TRUE(is.inertia.isApprox(was.inertia, 1e-4)) << was.name;
      EXPECT_TRUE(back.T_world_object[i].isApprox(scene.T_world_object[i], 1e-6)) << was.name;
    }
  }
}

// Every object turned by `tilt`, its lowest point on the table.
Scene tilted_row(const std::vector<ObjectPtr>& objects, double tilt) {
  Scene scene = row_of(objects);
  const Pose turned = make_pose(so3_exp({tilt, 0, 0}), Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < objects.size(); ++i) {
    double low = 0.0;
    for (const Eigen::Vector3d& v : objects[i]->mesh.vertices) low = std::min(low, (turned * v).z());
    scene.T_world_object[i] = at(0.15 * static_cast<double>(i), 0, -low) * turned;
  }
  return scene;
}

TEST_F(RoundTrip, VerdictsAgree) {
  for (const auto& objects : all_kinds()) {
    for (const double tilt : {0.0, 0.03, 0.6}) {
      const Scene scene = tilted_row(objects, tilt), back = written(scene).to_scene();
      const SettleResult here = Simulator(scene.objects).settle(scene.T_world_object),
                         there = Simulator(back.objects).settle(back.T_world_object);
      for (std::size_t i = 0; i < objects.size(); ++i) {
        const auto verdict = [i](const Scene& s, const SettleResult& result) {
          return is_stable(displacement({s.objects[i]}, {s.T_world_object[i]}, {result.T_world_object[i]}));
        };
        EXPECT_EQ(verdict(scene, here), verdict(back, there)) << objects[i]->name << " at " << tilt;
      }
    }
  }
}

TEST_F(RoundTrip, AfterSettlingTheObjectsStandWhereTheBodiesDo) {
  const Scene scene = row_of({make_block("cube"), make_block("tall_triangle")});
  const MjcfScene file = written(scene);
  const SettleResult settled = file.settle();
  const Scene back = file.to_scene(settled.T_world_object);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(back.T_world_object[i].isApprox(settled.T_world_object[i], 1e-6));
  }
}

}  // namespace
}  // namespace dofusion
