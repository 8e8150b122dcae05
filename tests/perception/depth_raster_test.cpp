#include "perception/depth_raster.h"

#include <cmath>

#include <gtest/gtest.h>

#include "perception/scanner.h"
#include "perception/synthetic_view.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

// Every block in random poses against the scanner's ray casting. The two may differ on outlines, where a ray passes
// within rounding of an edge: few pixels. Elsewhere inverse depth is a float: 1e-6 m is ten times its rounding.
TEST(DepthRaster, AgreesWithRayCasting) {
  const Camera camera = default_camera();
  const Pose T_world_camera = look_at({0.4, 0.1, 0.5}, {0.0, 0.0, 0.05});
  Rng rng = make_rng(5);
  DepthRaster raster(camera);
  ScannerOptions no_table;
  no_table.table = false;
  for (const std::string& name : block_names()) {
    const ObjectPtr object = make_block(name);
    Scanner scanner({object}, no_table);
    const Pose T_world_object = make_pose(random_rotation(rng), Eigen::Vector3d(0.0, 0.0, 0.05) + normal3(rng, 0.02));
    scanner.set_poses({T_world_object});
    const Scan scan = scanner.render(camera, T_world_camera);
    const RasterPatch& patch = raster.render(object->mesh, T_world_camera.inverse() * T_world_object);
    Image<float> rendered(camera.width, camera.height, 0.0f);
    for (int row = 0; row < patch.height; ++row) {
      for (int column = 0; column < patch.width; ++column) {
        const float w = patch.inverse_depth[static_cast<std::size_t>(row) * patch.width + column];
        if (w > 0.0f) rendered.at(patch.v0 + row, patch.u0 + column) = 1.0f / w;
      }
    }
    int seen = 0, only_one = 0;
    for (std::size_t i = 0; i < rendered.pixels.size(); ++i) {
      const float cast = scan.depth.pixels[i], drawn = rendered.pixels[i];
      if ((cast > 0.0f) != (drawn > 0.0f)) ++only_one;
      if (cast <= 0.0f || drawn <= 0.0f) continue;
      ++seen;
      ASSERT_NEAR(cast, drawn, 1e-6) << name;
    }
    EXPECT_GT(seen, 500) << name;
    EXPECT_LE(only_one, 3) << name;
  }
}

TEST(DepthRaster, KnowsTheFaceAndItsIncidence) {
  const Camera camera{100.0, 100.0, 50.0, 50.0, 101, 101, 0.1};
  const TriangleMesh box = box_mesh({0.2, 0.2, 0.2});
  DepthRaster raster(camera);
  const RasterPatch& patch = raster.render(box, make_pose(Eigen::Matrix3d::Identity(), {0.0, 0.0, 1.0}));
  const std::size_t middle = static_cast<std::size_t>(50 - patch.v0) * patch.width + (50 - patch.u0);
  EXPECT_NEAR(1.0 / patch.inverse_depth[middle], 0.9, 1e-6);
  const Eigen::Vector3i& t = box.triangles[patch.face[middle]];
  const Eigen::Vector3d normal =
      (box.vertices[t[1]] - box.vertices[t[0]]).cross(box.vertices[t[2]] - box.vertices[t[0]]).normalized();
  EXPECT_NEAR(normal.z(), -1.0, 1e-9);
  EXPECT_GT(patch.facing[middle], 0.99);
}

TEST(DepthRaster, OutsideTheImageThereIsNothing) {
  const Camera camera = default_camera();
  const TriangleMesh box = box_mesh({0.1, 0.1, 0.1});
  DepthRaster raster(camera);
  EXPECT_EQ(raster.render(box, make_pose(Eigen::Matrix3d::Identity(), {5.0, 0.0, 1.0})).width, 0);
  const RasterPatch& behind = raster.render(box, make_pose(Eigen::Matrix3d::Identity(), {0.0, 0.0, -1.0}));
  EXPECT_EQ(behind.width * behind.height, 0);
}

}  // namespace
}  // namespace dofusion
