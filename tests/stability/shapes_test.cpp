#include "stability/shapes.h"

#include <gtest/gtest.h>

#include <map>

#include "stability/mesh_io.h"

namespace dofusion {
namespace {

TEST(Blocks, HaveTheVolumesOfTheirTable) {
  // Worked out by hand in units of half a cube edge: section area × length, and base × height / 3 for the pyramid.
  const std::map<std::string, double> volumes = {{"cube", 8},           {"rectangle", 16},      {"half_rectangle", 8},
                                                 {"tall_triangle", 8},  {"middle_triangle", 4}, {"tetrahedron", 8.0 / 3},
                                                 {"hat", 4}};
  ASSERT_EQ(block_names().size(), 7u);
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = block_mesh(name);
    EXPECT_NEAR(volume(mesh) / std::pow(kBlockUnit, 3), volumes.at(name), 1e-9) << name;
    EXPECT_TRUE(is_closed(mesh)) << name;
    EXPECT_TRUE(is_convex(mesh)) << name;
    EXPECT_LT(centre_of_mass(mesh).norm(), 1e-12) << name;
  }
}

TEST(Blocks, ShippedMeshesAreTheSame) {
  for (const std::string& name : block_names()) {
    const TriangleMesh file = read_solid_mesh(std::string(DOFUSION_ASSETS_DIR) + "/blocks/" + name + ".obj");
    const TriangleMesh code = block_mesh(name);
    EXPECT_EQ(file.triangles.size(), code.triangles.size()) << name;
    EXPECT_NEAR(volume(file) / volume(code), 1.0, 1e-6) << name;  // the reader has single precision
    EXPECT_NEAR(diameter(file) / diameter(code), 1.0, 1e-6) << name;
    EXPECT_LT(centre_of_mass(file).norm(), 1e-8) << name;
  }
}

TEST(Blocks, UnknownNameIsRefusedWithTheChoices) {
  try {
    block_mesh("sphere");
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("half_rectangle"), std::string::npos);
  }
}

}  // namespace
}  // namespace dofusion
