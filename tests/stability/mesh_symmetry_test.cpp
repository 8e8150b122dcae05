#include "stability/mesh_symmetry.h"

#include <map>

#include <gtest/gtest.h>

#include "stability/scene.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

// The rotation groups of the seven blocks, from geometry: cube, two square cuboids' (D4; 4 x 2 x 1 only D2), a
// scalene, two isosceles prisms (C1, C2), a square pyramid (C4).
TEST(MeshSymmetry, GroupsOfTheBlocks) {
  const std::map<std::string, std::size_t> order = {
      {"cube", 24},       {"rectangle", 8}, {"half_rectangle", 4}, {"tall_triangle", 1}, {"middle_triangle", 2},
      {"tetrahedron", 4}, {"hat", 2}};
  for (const auto& [name, count] : order) {
    const TriangleMesh mesh = make_block(name)->mesh;
    const std::vector<Eigen::Matrix3d> symmetries = rotation_symmetries(mesh);
    EXPECT_EQ(symmetries.size(), count) << name;
    EXPECT_TRUE(symmetries.front().isIdentity()) << name;
    for (const Eigen::Matrix3d& R : symmetries) EXPECT_NEAR(R.determinant(), 1.0, 1e-9) << name;
  }
}

// Vertices in the middle of a face or an edge change nothing: a cube whose faces are fans around their centres.
TEST(MeshSymmetry, TheTriangulationDoesNotMatter) {
  TriangleMesh fans;
  const TriangleMesh cube = make_block("cube")->mesh;
  fans.vertices = cube.vertices;
  for (const PlanarFace& face : planar_faces(cube)) {
    const int centre = static_cast<int>(fans.vertices.size());
    fans.vertices.push_back(face.centroid);
    for (const Eigen::Vector3i& t : cube.triangles) {
      const Eigen::Vector3d &a = cube.vertices[t[0]], &b = cube.vertices[t[1]], &c = cube.vertices[t[2]];
      if ((b - a).cross(c - a).normalized().dot(face.normal) < 0.5) continue;
      for (int k = 0; k < 3; ++k) {
        const int from = t[k], to = t[(k + 1) % 3];
        const bool diagonal = (cube.vertices[from] - cube.vertices[to]).norm() > 0.06;  // the edges are 0.05
        if (!diagonal) fans.triangles.emplace_back(from, to, centre);
      }
    }
  }
  ASSERT_EQ(fans.triangles.size(), 24u);
  EXPECT_EQ(rotation_symmetries(fans).size(), 24u);
}

}  // namespace
}  // namespace dofusion
