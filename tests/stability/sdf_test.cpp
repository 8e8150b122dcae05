#include "stability/sdf.h"

#include <gtest/gtest.h>

#include "stability/scene.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

TEST(BoxSignedDistance, AtFaceEdgeCornerAndCentre) {
  const Vector3d edges(2, 4, 6);
  EXPECT_DOUBLE_EQ(box_signed_distance(edges, {0, 0, 0}), -1.0);
  EXPECT_DOUBLE_EQ(box_signed_distance(edges, {1.5, 0, 0}), 0.5);
  EXPECT_DOUBLE_EQ(box_signed_distance(edges, {1 + 3, 2 + 4, 0}), 5.0);
  EXPECT_NEAR(box_signed_distance(edges, {2, 3, 4}), std::sqrt(3.0), 1e-12);
}

TEST(MeshDistance, AgreesWithTheBoxInsideOutsideAndAlongItsEdges) {
  const Vector3d edges(0.05, 0.1, 0.02);
  const MeshDistance distance(box_mesh(edges));
  Rng rng = make_rng(6);
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p = normal3(rng, 0.05);
    EXPECT_NEAR(distance(p), box_signed_distance(edges, p), 1e-12);
  }
  // Right beside an edge and a corner, where counting ray crossings goes wrong.
  for (const double step : {1e-9, -1e-9}) {
    const Vector3d corner = edges / 2.0 + Vector3d::Constant(step);
    EXPECT_EQ(distance(corner) > 0.0, step > 0.0);
    const Vector3d edge(edges.x() / 2.0 + step, edges.y() / 2.0 + step, 0.003);
    EXPECT_EQ(distance(edge) > 0.0, step > 0.0);
  }
}

TEST(MeshDistance, OfConvexBlocksHasTheSignOfTheirPlanes) {
  Rng rng = make_rng(7);
  for (const ObjectPtr& block : all_blocks()) {
    const MeshDistance distance(block->mesh);
    for (int i = 0; i < 500; ++i) {
      const Vector3d p = normal3(rng, 0.03);
      double outermost = -1.0;
      for (const auto& t : block->mesh.triangles) {
        const Vector3d& a = block->mesh.vertices[t[0]];
        const Vector3d n = (block->mesh.vertices[t[1]] - a).cross(block->mesh.vertices[t[2]] - a).normalized();
        outermost = std::max(outermost, n.dot(p - a));
      }
      EXPECT_EQ(distance(p) > 0.0, outermost > 0.0) << block->name;
      if (outermost < 0.0) {
        EXPECT_NEAR(distance(p), outermost, 1e-12) << block->name;  // inside, the nearest plane
      }
    }
  }
}

TEST(SdfGrid, InterpolatesALinearFieldExactlyAndGrowsOutside) {
  const BoundingBox box{Vector3d(-1, -1, -1), Vector3d(1, 1, 1)};
  const SdfGrid grid = make_sdf_grid(box, [](const Vector3d& p) { return p.z(); }, {9, 0.25});
  Rng rng = make_rng(8);
  for (int i = 0; i < 200; ++i) {
    const double x = uniform(rng, -1.4, 1.4), y = uniform(rng, -1.4, 1.4), z = uniform(rng, -1.4, 1.4);
    EXPECT_NEAR(grid({x, y, z}), z, 1e-6);  // single-precision nodes
  }
  EXPECT_NEAR(grid({0, 0, 4.0}), 4.0, 1e-6);
  EXPECT_GT(grid({10, 0, 0}), 8.0);
}

TEST(SdfGrid, OfABlockIsNearTheExactDistance) {
  const TriangleMesh mesh = block_mesh("hat");
  const MeshDistance exact(mesh);
  const SdfGrid grid = make_sdf_grid(bounding_box(mesh), [&](const Vector3d& p) { return exact(p); }, {64, 0.25});
  Rng rng = make_rng(9);
  for (int i = 0; i < 1000; ++i) {
    const double x = uniform(rng, -0.03, 0.03), y = uniform(rng, -0.04, 0.04), z = uniform(rng, -0.02, 0.03);
    const Vector3d p(x, y, z);  // within the grid
    // A distance changes by at most the distance to the nearest node, half a cell's diagonal.
    EXPECT_NEAR(grid(p), exact(p), 0.87 * grid.spacing);
  }
}

}  // namespace
}  // namespace dofusion
