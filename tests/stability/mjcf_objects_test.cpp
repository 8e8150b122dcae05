// MJCF files as scenes of objects on a table.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/files.h"
#include "stability/mjcf_scene.h"
#include "stability/outcome.h"
#include "stability/robustness.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

class MjcfObjects : public testing::Test {
 protected:
  MjcfScene load(const std::string& inside, const std::string& world = "<geom type='plane' size='1 1 0.1'/>") {
    const std::string path = directory_ / "scene.xml";
    write_file(path, "<mujoco>" + before_ + "<worldbody>" + world + inside + "</worldbody>" + after_ + "</mujoco>");
    return MjcfScene(path);
  }
  MjcfScene body(const std::string& geoms) {
    return load("<body name='b' pos='1 0 0.5'><freejoint/>" + geoms + "</body>");
  }
  ObjectPtr object(const std::string& geoms) { return body(geoms).to_scene().objects.at(0); }
  void expect_refused(const MjcfScene& scene, const std::vector<std::string>& words) {
    try {
      scene.to_scene();
      ADD_FAILURE() << "is not refused: " << words.front();
    } catch (const InputError& e) {
      EXPECT_THAT(std::string(e.what()), HasSubstr("scene.xml"));
      for (const std::string& word : words) EXPECT_THAT(std::string(e.what()), HasSubstr(word));
    }
    EXPECT_NO_THROW(scene.settle());  // the file is of use as it is
  }
  std::string before_, after_;
  TemporaryDirectory directory_;
};

TEST_F(MjcfObjects, OneGeomIsAPrimitiveInItsOwnFrame) {
  const Scene scene = body("<geom type='box' size='0.1 0.2 0.3' pos='0 0 0.1' euler='0 0 90'/>").to_scene();
  EXPECT_EQ(scene.objects.at(0)->kind, SolidKind::kBox);
  EXPECT_TRUE(scene.objects[0]->box_edges->isApprox(Vector3d(0.2, 0.4, 0.6)));
  EXPECT_EQ(scene.objects[0]->name, "b");
  EXPECT_TRUE(scene.T_world_object[0].translation().isApprox(Vector3d(1, 0, 0.6)));
  EXPECT_NEAR(rotation_angle(scene.T_world_object[0].linear()), M_PI / 2, 1e-9);
  EXPECT_EQ(object("<geom type='cylinder' size='0.1 0.2'/>")->kind, SolidKind::kCylinder);
  EXPECT_EQ(object("<geom type='sphere' size='0.1'/>")->kind, SolidKind::kSphere);
}

TEST_F(MjcfObjects, RoundSolidsAreTessellatedFinely) {
  // The surface lies at most 0.005 radii inside: at most three times that share of the volume is missing.
  const ObjectPtr capsule = object("<geom type='capsule' size='0.1 0.2'/>");
  const double exact = M_PI * 0.01 * 0.4 + 4.0 / 3.0 * M_PI * 0.001;
  EXPECT_LT(capsule->volume, exact);
  EXPECT_NEAR(capsule->volume, exact, 0.015 * exact);
  EXPECT_NEAR(capsule->diameter, 0.6, 1e-9);
  const ObjectPtr ellipsoid = object("<geom type='ellipsoid' size='0.1 0.2 0.3'/>");
  EXPECT_NEAR(ellipsoid->volume, 4.0 / 3.0 * M_PI * 0.006, 0.015 * 4.0 / 3.0 * M_PI * 0.006);
  EXPECT_TRUE(capsule->convex && ellipsoid->convex);
}

TEST_F(MjcfObjects, AMeshIsItsHullAboutItsCentreOfMass) {
  // A corner notched out of a tetrahedron: MuJoCo collides the hull.
  before_ = "<asset><mesh name='m' vertex='0 0 0 0.1 0 0 0 0.1 0 0 0 0.1 0.01 0.01 0.01'/></asset>";
  const Scene scene = body("<geom type='mesh' mesh='m'/>").to_scene();
  EXPECT_NEAR(scene.objects.at(0)->volume, 1e-3 / 6.0, 1e-10);
  EXPECT_EQ(scene.objects[0]->mesh.vertices.size(), 4u);
  EXPECT_TRUE(scene.T_world_object[0].translation().isApprox(Vector3d(1.025, 0.025, 0.525), 1e-6));
}

TEST_F(MjcfObjects, SeveralGeomsAreOneSolidOfParts) {
  // An L of two boxes that share a face, one of them in a body fixed to the first: the figures of the solid by hand.
  const Scene scene = body(
                          "<geom type='box' size='0.1 0.1 0.1'/>"
                          "<body pos='0.2 0 0'><geom type='box' size='0.1 0.1 0.2' pos='0 0 0.1'/></body>")
                          .to_scene();
  ASSERT_EQ(scene.objects.size(), 1u);
  const Object& ell = *scene.objects[0];
  EXPECT_EQ(ell.kind, SolidKind::kMesh);
  EXPECT_EQ(ell.parts.size(), 2u);
  EXPECT_FALSE(ell.convex);
  EXPECT_NEAR(ell.volume, 0.024, 1e-12);
  const Vector3d centre = (0.008 * Vector3d::Zero() + 0.016 * Vector3d(0.2, 0, 0.1)) / 0.024;
  EXPECT_TRUE(scene.T_world_object[0].translation().isApprox(Vector3d(1, 0, 0.5) + centre, 1e-9));
  const double about_y = 0.008 * (0.04 + 0.04) / 12 + 0.016 * (0.04 + 0.16) / 12 + 0.008 * centre.squaredNorm() +
                         0.016 * (Vector3d(0.2, 0, 0.1) - centre).squaredNorm();
  EXPECT_NEAR(ell.inertia(1, 1), about_y, 1e-9);
}

TEST_F(MjcfObjects, WhatLiesWithinOrIsOnlyShownAddsNothing) {
  const ObjectPtr box = object(
      "<geom type='box' size='0.1 0.1 0.1'/><geom size='0.05'/><geom size='0.00001' pos='0.1 0.1 0.1'/>"
      "<geom type='box' size='0.1 0.1 0.1'/><geom size='0.5' contype='0' conaffinity='0' mass='0'/>");
  EXPECT_EQ(box->kind, SolidKind::kBox);
}

TEST_F(MjcfObjects, OverlappingGeomsAreRefused) {
  expect_refused(body("<geom type='capsule' size='0.05 0.1'/><geom size='0.08' pos='0 0 0.1'/>"), {"'b'", "overlap"});
  EXPECT_EQ(object("<geom size='0.05' pos='0 0 0.05'/><geom size='0.05' pos='0 0 -0.05'/>")->parts.size(), 2u);
}

TEST_F(MjcfObjects, WhatHasNoPlaceOnATableIsRefused) {
  const std::string ball = "<body name='ball' pos='0 0 0.1'><freejoint/><geom size='0.1'/></body>";
  expect_refused(load("<body name='arm' pos='0 0 1'><joint type='hinge' damping='1'/><geom size='0.1'/></body>"),
                 {"'arm'", "joint"});
  expect_refused(load("<body name='base' pos='0 0 2'><freejoint/><geom size='0.1'/><body name='finger' pos='0 0 0.5'>"
                      "<joint type='hinge'/><geom size='0.1'/></body></body>"),
                 {"'finger'"});
  expect_refused(load(ball + "<body name='shelf' pos='2 0 0'><geom type='box' size='0.1 0.1 0.1'/></body>"),
                 {"'shelf'"});
  expect_refused(load(ball, "<geom type='plane' size='1 1 1' pos='0 0 -0.01'/>"), {"'world'", "plane at z = 0"});
  expect_refused(load(ball, "<geom type='plane' size='1 1 1' euler='1 0 0'/>"), {"'world'"});
  expect_refused(load(ball, ""), {"no plane"});
  expect_refused(load("<body name='ghost'><freejoint/><geom size='0.1' contype='0' conaffinity='0'/></body>"),
                 {"'ghost'"});
  before_ = "<option gravity='1 0 -9'/>";
  expect_refused(load(ball), {"gravity"});
  before_ = "";
  after_ = "<equality><weld body1='ball'/></equality>";
  expect_refused(load(ball), {"constraints"});
}

TEST_F(MjcfObjects, AFixedPlaneThatIsTurnedAboutIsStillTheTable) {
  EXPECT_NO_THROW(load("", "<geom type='plane' size='1 1 1' pos='3 2 0' euler='0 0 40'/>").to_scene());
}

TEST_F(MjcfObjects, VerdictsOfTheFileAndOfItsObjectsAgree) {
  // Stem and head have the same mass, the stem is 0.1 wide: the T stands while its head is less than 0.1 off.
  for (const auto& [offset, stands] : {std::pair{0.02, true}, {0.13, false}}) {
    const std::string head = std::to_string(offset);
    const MjcfScene file = load(
        "<body name='tee' pos='0 0 0.1'><freejoint/><geom type='box' size='0.05 0.05 0.1'/>"
        "<geom type='box' size='0.1 0.05 0.05' pos='" +
        head + " 0 0.15'/></body>");
    const SceneBody& body = file.bodies().at(1);
    const std::vector<Pose> before = {file.initial_poses().at(1)};
    EXPECT_EQ(judge({body.diameter}, before, file.settle()).stable, stands);
    const Scene scene = file.to_scene();
    const Simulator simulator(scene.objects);
    EXPECT_EQ(judge(scene.objects, scene.T_world_object, simulator.settle(scene.T_world_object), 0).stable, stands);
    EXPECT_EQ(largest_push(simulator, scene.T_world_object, 0) > 0.0, stands);
  }
}

}  // namespace
}  // namespace dofusion
