#include "stability/mesh_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/files.h"
#include "stability/shapes.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

std::string error_of(const std::string& path) {
  try {
    read_solid_mesh(path);
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

TEST(MeshIo, ObjComesBack) {
  const TemporaryDirectory directory;
  const TriangleMesh mesh = block_mesh("tall_triangle");
  write_obj(mesh, directory / "m.obj");
  const TriangleMesh read = read_solid_mesh(directory / "m.obj");
  EXPECT_EQ(read.vertices.size(), mesh.vertices.size());
  EXPECT_EQ(read.triangles.size(), mesh.triangles.size());
  EXPECT_NEAR(volume(read) / volume(mesh), 1.0, 1e-6);  // the reader has single precision
}

TEST(MeshIo, AsciiStlIsWeldedAndScaled) {
  const TemporaryDirectory directory;
  const TriangleMesh mesh = box_mesh({10, 20, 30});  // millimetres
  std::string stl = "solid box\n";
  for (const auto& t : mesh.triangles) {
    stl += "facet normal 0 0 0\nouter loop\n";
    for (int k = 0; k < 3; ++k) {
      const auto& v = mesh.vertices[t[k]];
      stl += "vertex " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) + "\n";
    }
    stl += "endloop\nendfacet\n";
  }
  write_file(directory / "box.stl", stl + "endsolid box\n");
  const TriangleMesh read = read_solid_mesh((directory / "box.stl"), 1e-3);
  EXPECT_EQ(read.vertices.size(), 8u);
  EXPECT_NEAR(volume(read), 6e-6, 1e-11);
}

TEST(MeshIo, TurnsAMeshThatIsInsideOut) {
  const TemporaryDirectory directory;
  TriangleMesh mesh = box_mesh({1, 1, 1});
  for (auto& t : mesh.triangles) std::swap(t[0], t[1]);
  write_obj(mesh, directory / "m.obj");
  EXPECT_NEAR(volume(read_solid_mesh(directory / "m.obj")), 1.0, 1e-6);
}

TEST(MeshIo, BadMeshesAreNamedWithWhatIsWrong) {
  const TemporaryDirectory directory;
  EXPECT_THAT(error_of(directory / "none.obj"), testing::HasSubstr("none.obj: no such mesh"));
  write_file(directory / "empty.obj", "");
  EXPECT_THAT(error_of(directory / "empty.obj"), testing::HasSubstr("empty.obj: "));
  TriangleMesh open = box_mesh({1, 1, 1});
  open.triangles.pop_back();
  write_obj(open, directory / "open.obj");
  EXPECT_THAT(error_of(directory / "open.obj"), testing::HasSubstr("open.obj: the mesh is open"));
  write_file(directory / "nan.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n");
  EXPECT_THAT(error_of(directory / "nan.obj"), testing::HasSubstr("nan.obj: "));
}

}  // namespace
}  // namespace dofusion
