#include "perception/unknown_recovery.h"

#include <limits>

#include <gtest/gtest.h>

#include "box_image.h"

namespace dofusion {
namespace {

const DepthSigma kSigma{0.0, 1.7e-3};
const Pose kView = look_at({0.15, -0.55, 0.5}, {0.0, 0.0, 0.03});

struct Recovered {
  Table table;
  std::vector<RecoveredObject> objects;
};

Recovered recover(const std::vector<TriangleMesh>& meshes) {
  const BoxImage image = render_boxes(meshes, test_camera(), kView, kSigma, 8);
  const Table table = find_table(image.depth, test_camera()).value();
  return {table, recover_unknown(image.depth, test_camera(), table, image.labels)};
}

BoundingBox world_box(const RecoveredObject& object) {
  TriangleMesh mesh = object.object->mesh;
  for (Eigen::Vector3d& v : mesh.vertices) v = object.T_world_object * v;
  return bounding_box(mesh);
}

TEST(UnknownRecovery, ABoxComesOutAsItself) {
  const Eigen::Vector3d edges(0.1, 0.06, 0.08);
  const Recovered r = recover({upright_box(edges, {0, 0, 0.04}, 0.4)});
  ASSERT_EQ(r.objects.size(), 1U);
  const Object& object = *r.objects[0].object;
  ASSERT_TRUE(object.box_edges);
  Eigen::Vector3d sides = *object.box_edges, truth = edges;
  std::sort(sides.begin(), sides.end());
  std::sort(truth.begin(), truth.end());
  // Faces are known to a fraction of a millimetre, the hidden sides to about a pixel (1.4 mm) and a sigma.
  EXPECT_LT((sides - truth).cwiseAbs().maxCoeff(), 0.004);
  EXPECT_NEAR(world_box(r.objects[0]).min.z(), 0.0, 1e-6);
  EXPECT_TRUE(is_closed(object.mesh));
  EXPECT_GT(r.objects[0].score, 0.9);
  EXPECT_EQ(r.objects[0].label, 2);
}

TEST(UnknownRecovery, ACylinderComesOutRound) {
  std::vector<Eigen::Vector2d> circle;
  for (int i = 0; i < 48; ++i) circle.emplace_back(0.05 * std::cos(i * M_PI / 24), 0.05 * std::sin(i * M_PI / 24));
  const Recovered r = recover({prism_mesh(circle, 0.0, 0.1)});
  ASSERT_EQ(r.objects.size(), 1U);
  EXPECT_GE(r.objects[0].object->mesh.triangles.size(), 40U);
  EXPECT_NEAR(r.objects[0].object->volume, M_PI * 0.05 * 0.05 * 0.1, 0.1 * M_PI * 0.05 * 0.05 * 0.1);
}

TEST(UnknownRecovery, AWedgeKeepsItsSlope) {
  // A right-angled wedge, 80 mm long, 60 mm high: half of its bounding box.
  TriangleMesh wedge = prism_mesh({{-0.04, 0.0}, {0.04, 0.0}, {-0.04, 0.06}}, -0.04, 0.04);
  for (Eigen::Vector3d& v : wedge.vertices) v = Eigen::Vector3d(v.x(), -v.z(), v.y());
  const Recovered r = recover({wedge});
  ASSERT_EQ(r.objects.size(), 1U);
  EXPECT_NEAR(r.objects[0].object->volume, 0.5 * 0.08 * 0.06 * 0.08, 0.15 * 0.5 * 0.08 * 0.06 * 0.08);
}

TEST(UnknownRecovery, StackedBoxesRestOnEachOther) {
  const Recovered r =
      recover({upright_box({0.2, 0.16, 0.05}, {0, 0, 0.025}, 0.2), upright_box({0.07, 0.07, 0.08}, {0, 0, 0.09}, 0.7)});
  ASSERT_EQ(r.objects.size(), 2U);
  EXPECT_NEAR(world_box(r.objects[0]).max.z(), 0.05, 0.002);
  EXPECT_NEAR(world_box(r.objects[1]).min.z(), world_box(r.objects[0]).max.z(), 2e-4);
}

TEST(UnknownRecovery, NeighboursDoNotOverlap) {
  const Recovered r = recover(
      {upright_box({0.24, 0.06, 0.15}, {0, 0.1, 0.075}, 0.0), upright_box({0.08, 0.08, 0.07}, {0, 0.03, 0.035}, 0.0)});
  ASSERT_EQ(r.objects.size(), 2U);
  std::vector<TriangleMesh> meshes;
  for (const RecoveredObject& object : r.objects) {
    meshes.push_back(object.object->mesh);
    for (Eigen::Vector3d& v : meshes.back().vertices) v = object.T_world_object * v;
  }
  EXPECT_LT(find_overlap(meshes[0], meshes[1]).depth, 1e-3);
}

TEST(UnknownRecovery, AnObjectAtTheBorderOfTheImageIsRecovered) {
  const Recovered r = recover({upright_box({0.3, 0.3, 0.1}, {0.35, 0, 0.05}, 0.1)});
  ASSERT_EQ(r.objects.size(), 1U);
  EXPECT_TRUE(is_closed(r.objects[0].object->mesh));
}

TEST(UnknownRecovery, NothingInNothingOut) {
  const Camera camera = test_camera();
  const Table table = table_from_plane({0.0, 1.2, 1.2});
  const DepthImage empty(camera.width, camera.height);
  EXPECT_TRUE(recover_unknown(empty, camera, table, LabelImage(camera.width, camera.height, 0)).empty());
  EXPECT_TRUE(recover_unknown(empty, camera, table, LabelImage(camera.width, camera.height, 2)).empty());
  const DepthImage nan(camera.width, camera.height, std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(recover_unknown(nan, camera, table, LabelImage(camera.width, camera.height, 2)).empty());
  const Camera tiny{1.0, 1.0, 0.0, 0.0, 1, 1, 1.0};
  EXPECT_TRUE(recover_unknown(DepthImage(1, 1, 0.5F), tiny, table, LabelImage(1, 1, 2)).empty());
  EXPECT_THROW(recover_unknown(empty, camera, table, LabelImage(1, 1)), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
