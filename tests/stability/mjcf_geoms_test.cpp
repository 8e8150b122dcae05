#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/files.h"
#include "stability/geom.h"
#include "stability/mjcf_scene.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

class MjcfGeomsTest : public testing::Test {
 protected:
  std::string file(const std::string& inside) {
    const std::string path = directory_ / "scene.xml";
    write_file(path, "<mujoco>" + inside + "</mujoco>");
    return path;
  }
  MjcfScene scene(const std::string& world, const std::string& before = "") {
    return MjcfScene(file(before + "<worldbody>" + world + "</worldbody>"));
  }
  void expect_refused(const std::string& inside, const std::string& why) {
    const std::string path = file(inside);
    try {
      MjcfScene{path};
      ADD_FAILURE() << "is not refused: " << why;
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr(path));
      EXPECT_THAT(e.what(), HasSubstr(why));
    }
  }
  TemporaryDirectory directory_;
};

Pose world_pose(const MjcfScene& scene, const Geom& geom) {
  return scene.initial_poses().at(static_cast<std::size_t>(geom.body)) * geom.T_body_geom;
}

TEST_F(MjcfGeomsTest, TypesSizesGroupsAndColours) {
  const MjcfScene s = scene(
      "<geom name='floor' type='plane' size='1 2 0.1' material='red'/>"
      "<body name='b'><freejoint/>"
      "<geom type='sphere' size='0.1' group='4' rgba='0 1 0 0.5'/>"
      "<geom type='capsule' size='0.1 0.2' material='red' rgba='0 0 1 1'/>"
      "<geom type='ellipsoid' size='0.1 0.2 0.3' contype='0' conaffinity='0'/>"
      "<geom type='cylinder' size='0.1 0.2'/><geom type='box' size='0.1 0.2 0.3'/></body>",
      "<asset><material name='red' rgba='1 0 0 1'/></asset>");
  ASSERT_EQ(s.geoms().size(), 6u);
  const std::vector<GeomType> types{GeomType::kPlane,     GeomType::kSphere,   GeomType::kCapsule,
                                    GeomType::kEllipsoid, GeomType::kCylinder, GeomType::kBox};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(s.geoms()[i].type, types[i]);
    EXPECT_EQ(s.geoms()[i].body, i == 0 ? 0 : 1);
    EXPECT_EQ(s.geoms()[i].touchable, i != 3);
  }
  EXPECT_EQ(s.geoms()[0].name, "floor");
  EXPECT_EQ(s.geoms()[0].size.head<2>(), Eigen::Vector2d(1, 2));
  EXPECT_EQ(s.geoms()[5].size, Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(s.geoms()[1].group, 4);
  EXPECT_EQ(s.geoms()[0].rgba, (std::array<float, 4>{1, 0, 0, 1}));
  EXPECT_EQ(s.geoms()[1].rgba, (std::array<float, 4>{0, 1, 0, 0.5f}));
  EXPECT_EQ(s.geoms()[2].rgba, (std::array<float, 4>{0, 0, 1, 1}));  // its own goes before its material's
}

TEST_F(MjcfGeomsTest, PosesAreRelativeToTheBodysCentreOfMass) {
  // Two spheres of equal mass: the centre of mass is between them.
  const MjcfScene s = scene(
      "<body name='b' pos='1 2 3' euler='0 0 90'><freejoint/>"
      "<geom type='sphere' size='0.1' pos='0.2 0 0'/><geom type='sphere' size='0.1' pos='0.4 0 0'/></body>");
  EXPECT_NEAR(s.geoms()[0].T_body_geom.translation().x(), -0.1, 1e-9);
  EXPECT_LT((world_pose(s, s.geoms()[1]).translation() - Vector3d(1, 2.4, 3)).norm(), 1e-9);
  // Moved, geoms follow.
  const Pose moved = make_pose(Eigen::Matrix3d::Identity(), {0, 0, 1});
  const std::vector<Pose> poses = s.poses({moved});
  EXPECT_LT(((poses.at(0) * s.geoms()[1].T_body_geom).translation() - Vector3d(0.1, 0, 1)).norm(), 1e-9);
  EXPECT_THROW(s.poses({}), std::invalid_argument);
}

TEST_F(MjcfGeomsTest, MeshesLieWhereTheFileHasThem) {
  const MjcfScene s =
      scene("<body pos='0 0 1'><freejoint/><geom type='mesh' mesh='t'/><geom type='mesh' mesh='t'/></body>",
            "<asset><mesh name='t' vertex='0 0 0  0.3 0 0  0 0.2 0  0 0 0.1'/></asset>");
  ASSERT_TRUE(s.geoms()[0].mesh);
  EXPECT_EQ(s.geoms()[0].mesh, s.geoms()[1].mesh);
  const Pose T = world_pose(s, s.geoms()[0]);
  for (const Vector3d& corner : {Vector3d(0, 0, 1), Vector3d(0.3, 0, 1), Vector3d(0, 0.2, 1), Vector3d(0, 0, 1.1)}) {
    double nearest = 1.0;
    for (const Vector3d& v : s.geoms()[0].mesh->vertices) nearest = std::min(nearest, (T * v - corner).norm());
    EXPECT_LT(nearest, 1e-6);  // MuJoCo keeps vertices as floats
  }
  EXPECT_NEAR(volume(*s.geoms()[0].mesh), 0.3 * 0.2 * 0.1 / 6, 1e-8);  // its triangles face outwards
}

TEST_F(MjcfGeomsTest, BodiesThatAreOnlySeenAreBodies) {
  const MjcfScene s = scene(
      "<body name='ghost' pos='0 0 1'><geom type='box' size='1 1 1' contype='0' conaffinity='0'/></body>"
      "<geom type='plane' size='1 1 1'/>");
  ASSERT_EQ(s.bodies().size(), 2u);
  EXPECT_EQ(s.bodies()[1].name, "ghost");
  EXPECT_FALSE(s.bodies()[1].moves);
  EXPECT_EQ(s.geoms()[1].body, 1);
  EXPECT_FALSE(s.geoms()[1].touchable);
}

TEST_F(MjcfGeomsTest, Cameras) {
  const MjcfScene s = scene(
      "<geom type='plane' size='1 1 1'/><camera name='top' pos='0 0 2' fovy='60'/>"
      "<body name='b' pos='1 0 1'><freejoint/><geom type='sphere' size='0.1' pos='0 0 0.5'/>"
      "<camera name='eye' pos='0 0 0.1'/><camera name='tracks' mode='track' pos='0 0 0.2'/>"
      "<body><camera name='rides' pos='0 0 0.3'/></body></body>");
  ASSERT_EQ(s.cameras().size(), 4u);
  const SceneCamera& top = s.cameras()[0];
  EXPECT_EQ(top.name, "top");
  EXPECT_EQ(top.body, -1);
  EXPECT_NEAR(top.fovy, M_PI / 3, 1e-12);
  const Pose T = camera_pose(top, s.initial_poses());
  EXPECT_LT((T.translation() - Vector3d(0, 0, 2)).norm(), 1e-12);
  EXPECT_LT((T.linear().col(2) + Vector3d::UnitZ()).norm(), 1e-12);  // MuJoCo's cameras look down unless turned
  EXPECT_LT((T.linear().col(0) - Vector3d::UnitX()).norm(), 1e-12);
  const std::vector<Pose> moved = s.poses({make_pose(Eigen::Matrix3d::Identity(), {0, 0, 5.5})});  // centre of mass
  EXPECT_LT((camera_pose(s.cameras()[1], moved).translation() - Vector3d(0, 0, 5.1)).norm(), 1e-9);
  EXPECT_LT((camera_pose(s.cameras()[2], moved).translation() - Vector3d(1, 0, 1.2)).norm(), 1e-9);  // stays
  EXPECT_LT((camera_pose(s.cameras()[3], moved).translation() - Vector3d(0, 0, 5.3)).norm(), 1e-9);
}

TEST_F(MjcfGeomsTest, CamerasThatMakeNoSense) {
  const std::string plane = "<worldbody><geom type='plane' size='1 1 1'/>";
  expect_refused(plane + "<camera name='c' fovy='0'/></worldbody>", "fovy");
  expect_refused(plane + "<camera name='c' fovy='-20'/></worldbody>", "fovy");
}

}  // namespace
}  // namespace dofusion
