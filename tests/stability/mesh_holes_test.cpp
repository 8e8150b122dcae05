#include "stability/mesh_holes.h"

#include <algorithm>
#include <stdexcept>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "stability/shapes.h"
#include "stability/swept_mesh.h"

namespace dofusion {
namespace {

template <typename Condition>
TriangleMesh without(TriangleMesh mesh, const Condition& condition) {
  const auto gone = [&](const Eigen::Vector3i& t) {
    return condition((mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0);
  };
  mesh.triangles.erase(std::remove_if(mesh.triangles.begin(), mesh.triangles.end(), gone), mesh.triangles.end());
  return mesh;
}

TEST(MeshHoles, AClosedMeshStaysAsItIs) {
  const FilledMesh filled = fill_holes(block_mesh("hat"));
  EXPECT_EQ(filled.holes, 0u);
  EXPECT_EQ(filled.open_edges, 0u);
  EXPECT_EQ(filled.area_share, 0.0);
  EXPECT_EQ(filled.mesh.triangles.size(), block_mesh("hat").triangles.size());
}

TEST(MeshHoles, ACubesMissingTriangleAndFaceComeBack) {
  TriangleMesh cube = box_mesh({1, 1, 1});
  cube.triangles.pop_back();
  const FilledMesh triangle = fill_holes(cube);
  EXPECT_EQ(triangle.holes, 1u);
  EXPECT_EQ(triangle.open_edges, 3u);
  EXPECT_NEAR(triangle.area_share, 1.0 / 12.0, 1e-12);
  EXPECT_TRUE(is_closed(triangle.mesh));
  EXPECT_NEAR(volume(triangle.mesh), 1.0, 1e-12);
  EXPECT_LE(triangle.area_share, kMostOpenShare);

  const auto on_top = [](const Eigen::Vector3d& c) { return c.z() > 0.49; };
  const FilledMesh face = fill_holes(without(box_mesh({1, 1, 1}), on_top));
  EXPECT_EQ(face.holes, 1u);
  EXPECT_NEAR(face.area_share, 1.0 / 6.0, 1e-12);
  EXPECT_TRUE(is_closed(face.mesh));
  EXPECT_NEAR(volume(face.mesh), 1.0, 1e-12);
  EXPECT_GT(face.area_share, kMostOpenShare);
}

TEST(MeshHoles, AHoleThatIsNotConvexIsFilledWithItsOwnArea) {
  // An L's cap has a corner that points inwards, and here also corners in a row.
  const std::vector<Eigen::Vector2d> outline{{0, 0}, {1, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}, {0, 1}};
  const TriangleMesh ell = extrusion_mesh(outline, 0.0, 5.0);
  const FilledMesh filled = fill_holes(without(ell, [](const Eigen::Vector3d& c) { return c.z() > 4.99; }));
  EXPECT_TRUE(is_closed(filled.mesh));
  EXPECT_NEAR(volume(filled.mesh), 15.0, 1e-12);
  EXPECT_NEAR(filled.area_share * surface_area(filled.mesh), 3.0, 1e-12);
  EXPECT_EQ(filled.mesh.triangles.size(), ell.triangles.size());
  for (const Eigen::Vector3i& t : filled.mesh.triangles) {
    const Eigen::Vector3d& a = filled.mesh.vertices[t[0]];
    EXPECT_GT((filled.mesh.vertices[t[1]] - a).cross(filled.mesh.vertices[t[2]] - a).norm(), 0.1);
  }
}

TEST(MeshHoles, SeveralHolesAlsoSuchThatTouchAreFilledApart) {
  // Two triangles of a sphere that have one corner in common, and one elsewhere.
  TriangleMesh sphere = sphere_mesh(1.0);
  const double whole = volume(sphere);
  const Eigen::Vector3i first = sphere.triangles.front();
  const auto touching = std::find_if(sphere.triangles.begin() + 1, sphere.triangles.end(), [&](const auto& t) {
    int shared = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) shared += t[i] == first[j];
    return shared == 1;
  });
  ASSERT_NE(touching, sphere.triangles.end());
  const auto apart = std::find_if(sphere.triangles.begin() + 1, sphere.triangles.end(), [&](const auto& t) {
    return (sphere.vertices[t[0]] - sphere.vertices[first[0]]).norm() > 1.5;
  });
  ASSERT_NE(apart, sphere.triangles.end());
  const std::vector<Eigen::Vector3i> gone{first, *touching, *apart};
  for (const Eigen::Vector3i& t : gone)
    sphere.triangles.erase(std::find(sphere.triangles.begin(), sphere.triangles.end(), t));
  const FilledMesh filled = fill_holes(sphere);
  EXPECT_EQ(filled.holes, 3u);
  EXPECT_EQ(filled.open_edges, 9u);
  EXPECT_TRUE(is_closed(filled.mesh));
  EXPECT_NEAR(volume(filled.mesh), whole, 1e-12);
}

TEST(MeshHoles, AHoleOfVeryManyEdgesIsFilledByAFan) {
  std::vector<Eigen::Vector2d> circle;
  for (int i = 0; i < 1000; ++i) circle.emplace_back(std::cos(2 * M_PI * i / 1000), std::sin(2 * M_PI * i / 1000));
  TriangleMesh can = extrusion_mesh(circle, 0.0, 1.0);
  const double whole = volume(can);
  can = without(can, [](const Eigen::Vector3d& c) { return c.z() > 0.99; });
  const FilledMesh filled = fill_holes(can);
  EXPECT_EQ(filled.open_edges, 1000u);
  EXPECT_TRUE(is_closed(filled.mesh));
  EXPECT_NEAR(volume(filled.mesh), whole, 1e-9);
}

TEST(MeshHoles, ASheetIsAllHole) {
  const TriangleMesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  EXPECT_NEAR(fill_holes(sheet).area_share, 0.5, 1e-12);
}

TEST(MeshHoles, TrianglesThatDisagreeAreRefused) {
  TriangleMesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 3, 2}}};
  EXPECT_THROW(fill_holes(sheet), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
