#include "stability/mesh_io.h"

#include <algorithm>
#include <cstdint>

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

void write_text(const std::string& path, const TriangleMesh& mesh) { write_file(path, to_obj(mesh)); }

TriangleMesh joined(TriangleMesh a, const TriangleMesh& b) {
  const Eigen::Vector3i first = Eigen::Vector3i::Constant(static_cast<int>(a.vertices.size()));
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Eigen::Vector3i& t : b.triangles) a.triangles.push_back(t + first);
  return a;
}

TriangleMesh inside_out(TriangleMesh mesh) {
  for (auto& t : mesh.triangles) std::swap(t[0], t[1]);
  return mesh;
}

TEST(MeshIo, AHoleIsShownInTheFilesOwnCoordinates) {
  const TemporaryDirectory directory;
  TriangleMesh open = box_mesh({20, 40, 60});  // millimetres
  open.triangles.pop_back();
  write_text(directory / "open.obj", open);
  try {
    read_solid_mesh(directory / "open.obj", 0.001);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(),
                testing::AllOf(testing::HasSubstr("30)"), testing::HasSubstr("the first of 3, belongs to one"),
                               testing::HasSubstr("close its holes"), testing::Not(testing::HasSubstr("\n"))));
  }
}

TEST(MeshIo, SmallHolesAreFilledWhereThatIsAskedForAndNoted) {
  const TemporaryDirectory directory;
  TriangleMesh open = box_mesh({40, 40, 40});  // millimetres
  open.triangles.pop_back();
  std::swap(open.triangles[3][0], open.triangles[3][1]);  // flipped as well
  write_text(directory / "open.obj", open);
  const MendedMesh mended = read_mended_mesh(directory / "open.obj", 0.001);
  EXPECT_TRUE(is_closed(mended.mesh));
  EXPECT_NEAR(volume(mended.mesh), 64e-6, 1e-11);
  EXPECT_EQ(mended.holes, 1u);
  EXPECT_EQ(mending_note("open.obj", mended).rfind("open.obj: 1 hole (3 open edges) filled, ", 0), 0u);
  write_text(directory / "closed.obj", box_mesh({40, 40, 40}));
  EXPECT_EQ(mending_note("closed.obj", read_mended_mesh(directory / "closed.obj")), "");
}

TEST(MeshIo, WhatIsClearlyOpenIsNotFilled) {
  const TemporaryDirectory directory;
  TriangleMesh cup = box_mesh({1, 1, 1});
  cup.triangles.erase(std::remove_if(cup.triangles.begin(), cup.triangles.end(),
                                     [&](const Eigen::Vector3i& t) {
                                       return cup.vertices[t[0]].z() > 0 && cup.vertices[t[1]].z() > 0 &&
                                              cup.vertices[t[2]].z() > 0;
                                     }),
                      cup.triangles.end());
  write_text(directory / "cup.obj", cup);
  try {
    read_mended_mesh(directory / "cup.obj");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), testing::AllOf(testing::HasSubstr("cup.obj: the mesh is open"), testing::HasSubstr("16.7 %"),
                                         testing::HasSubstr("more than 10 %"), testing::HasSubstr("close its holes")));
  }
  write_file(directory / "sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_THROW(read_mended_mesh(directory / "sheet.obj"), InputError);
}

TEST(MeshIo, FlippedAndRepeatedTrianglesAreRepaired) {
  const TemporaryDirectory directory;
  TriangleMesh mesh = sphere_mesh(1.0);
  for (std::size_t i = 0; i < mesh.triangles.size(); i += 3) std::swap(mesh.triangles[i][0], mesh.triangles[i][2]);
  write_text(directory / "flipped.obj", mesh);
  EXPECT_NEAR(volume(read_solid_mesh(directory / "flipped.obj")) / volume(sphere_mesh(1.0)), 1.0, 1e-6);
  write_text(directory / "twice.obj", joined(box_mesh({1, 1, 1}), box_mesh({1, 1, 1})));
  EXPECT_NEAR(volume(read_solid_mesh(directory / "twice.obj")), 1.0, 1e-6);
}

TEST(MeshIo, ShellsApartTouchingAndNestedAreSolids) {
  const TemporaryDirectory directory;
  const TriangleMesh box = box_mesh({1, 1, 1});
  write_text(directory / "apart.obj", joined(box, translated(box, {3, 0, 0})));
  EXPECT_NEAR(volume(read_solid_mesh(directory / "apart.obj")), 2.0, 1e-6);
  write_text(directory / "one_inside_out.obj", joined(box, translated(inside_out(box), {3, 0, 0})));
  EXPECT_NEAR(volume(read_solid_mesh(directory / "one_inside_out.obj")), 2.0, 1e-6);
  write_text(directory / "touching.obj", joined(box, translated(box, {1, 1, 0})));
  EXPECT_NEAR(volume(read_solid_mesh(directory / "touching.obj")), 2.0, 1e-6);
  write_text(directory / "hollow.obj", joined(box_mesh({3, 3, 3}), inside_out(box)));
  EXPECT_NEAR(volume(read_solid_mesh(directory / "hollow.obj")), 26.0, 1e-5);
}

TEST(MeshIo, SurfacesThatBoundNoSolidAreNamed) {
  const TemporaryDirectory directory;
  const TriangleMesh box = box_mesh({1, 1, 1});
  TriangleMesh wall = joined(box, translated(box, {1, 0, 0}));  // the halves have two walls between them; keep one
  wall.triangles.erase(std::remove_if(wall.triangles.begin() + 12, wall.triangles.end(),
                                      [&](const Eigen::Vector3i& t) {
                                        return wall.vertices[t[0]].x() == 0.5 && wall.vertices[t[1]].x() == 0.5 &&
                                               wall.vertices[t[2]].x() == 0.5;
                                      }),
                       wall.triangles.end());
  write_text(directory / "wall.obj", wall);
  EXPECT_THAT(error_of(directory / "wall.obj"),
              testing::AllOf(testing::HasSubstr("inner wall"), testing::HasSubstr("3 triangles"),
                             testing::HasSubstr("(0.5, ")));
  write_text(directory / "double.obj", joined(box, inside_out(box)));
  EXPECT_THAT(error_of(directory / "double.obj"), testing::HasSubstr("both directions"));
  write_file(directory / "flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 3 2\n");
  EXPECT_THAT(error_of(directory / "flat.obj"), testing::HasSubstr("no volume"));
  write_file(directory / "points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  EXPECT_THAT(error_of(directory / "points.obj"), testing::HasSubstr("points.obj: "));
  write_text(directory / "far.obj", translated(box, {1e6, 0, 0}));
  EXPECT_THAT(error_of(directory / "far.obj"), testing::HasSubstr("origin"));
}

TEST(MeshIo, CoordinatesThatAreNotFiniteAreRefusedInEveryFormat) {
  const TemporaryDirectory directory;
  for (const std::string value : {"nan", "inf", "-inf", "1e39", "NaN", "-nan"}) {
    write_file(directory / "m.obj",
               "v 0 0 0\nv 1 0 0\nv 0 " + value + " 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
    EXPECT_THAT(error_of(directory / "m.obj"), testing::AllOf(testing::HasSubstr("m.obj: "), testing::Not("no error")))
        << value;
    write_file(directory / "m.stl", "solid m\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 " +
                                        value + " 0\nendloop\nendfacet\nendsolid m\n");
    EXPECT_THAT(error_of(directory / "m.stl"), testing::HasSubstr("m.stl: ")) << value;
    write_file(directory / "m.ply",
               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
               "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 " +
                   value + " 0\n3 0 1 2\n");
    EXPECT_THAT(error_of(directory / "m.ply"), testing::HasSubstr("m.ply: ")) << value;
  }
}

// A binary STL of a cube whose faces are grids of n x n squares.
std::string fine_cube_stl(int n) {
  std::string bytes(80, ' ');
  const auto triangles = static_cast<std::uint32_t>(12 * n * n);
  bytes.append(reinterpret_cast<const char*>(&triangles), 4);
  const auto corner = [n](int axis, double side, int i, int j) {
    Eigen::Vector3d v;
    v[axis] = side;
    v[(axis + 1) % 3] = 2.0 * i / n - 1.0;
    v[(axis + 2) % 3] = 2.0 * j / n - 1.0;
    return Eigen::Vector3f(v.cast<float>());
  };
  const auto add = [&](const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
    const Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    for (const Eigen::Vector3f* p : {&normal, &a, &b, &c}) bytes.append(reinterpret_cast<const char*>(p->data()), 12);
    bytes.append(2, '\0');
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          const auto a = corner(axis, side, i, j), b = corner(axis, side, i + 1, j),
                     c = corner(axis, side, i + 1, j + 1), d = corner(axis, side, i, j + 1);
          add(a, side > 0 ? b : c, side > 0 ? c : b);
          add(a, side > 0 ? c : d, side > 0 ? d : c);
        }
      }
    }
  }
  return bytes;
}

TEST(MeshIo, AMillionTrianglesAreRead) {
  const TemporaryDirectory directory;
  write_file(directory / "fine.stl", fine_cube_stl(289));
  const TriangleMesh cube = read_solid_mesh(directory / "fine.stl");
  EXPECT_EQ(cube.triangles.size(), 12u * 289 * 289);
  EXPECT_NEAR(volume(cube), 8.0, 1e-5);
}

TEST(MeshIo, SizesThatSuggestAnotherUnitAreNamedWithIt) {
  check_object_size("m.obj", 0.0866, 1.0, "--unit");
  check_object_size("m.obj", 10.0, 1.0, "--unit");
  const auto message = [](double diameter, double unit) {
    try {
      check_object_size("m.obj", diameter, unit, "--unit");
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(message(86.6, 1.0),
            "m.obj: the object measures 86.6 m; give the unit of its coordinates with --unit: "
            "0.001 would make it 0.0866 m");
  EXPECT_EQ(message(8e-5, 0.001),
            "m.obj: the object measures 8e-05 m; give the unit of its coordinates with --unit: "
            "1 would make it 0.08 m");
  EXPECT_EQ(message(1e9, 1.0), "m.obj: the object measures 1e+09 m; give the unit of its coordinates with --unit");
}

// Damaged files that assimp 5.2.4 does not return from.
TEST(MeshIo, AFileThatTheReaderNeverEndsOnIsRefused) {
  const TemporaryDirectory directory;
  write_file(directory / "m.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
             "element face 1\nproperty list uchar int vertex_indices\nend_of_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  EXPECT_THAT(error_of(directory / "m.ply"), testing::HasSubstr("m.ply: not a mesh that can be read"));
}

}  // namespace
}  // namespace dofusion
