#include "stability/mesh_topology.h"

#include <gtest/gtest.h>

#include "stability/random.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

TriangleMesh joined(TriangleMesh a, const TriangleMesh& b) {
  const Eigen::Vector3i first = Eigen::Vector3i::Constant(static_cast<int>(a.vertices.size()));
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Eigen::Vector3i& t : b.triangles) a.triangles.push_back(t + first);
  return a;
}

TriangleMesh inside_out(TriangleMesh mesh) {
  for (Eigen::Vector3i& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

// Every triangle turned with probability one half.
TriangleMesh shuffled_winding(TriangleMesh mesh, Rng& rng) {
  for (Eigen::Vector3i& t : mesh.triangles) {
    if (uniform(rng) < 0.5) std::swap(t[1], t[2]);
  }
  return mesh;
}

double repaired_volume(const TriangleMesh& mesh) {
  const std::optional<ConsistentWinding> wound = wound_consistently(mesh);
  return wound ? volume(with_outward_shells(*wound)) : std::nan("");
}

TEST(MeshTopology, PositionsAreComparedExactly) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {-0.0, 0, 0}, {1, 0, 1e-300}, {1, 0, 0}};
  EXPECT_EQ(position_ids(mesh), (std::vector<int>{0, 1, 0, 3, 1}));
}

TEST(MeshTopology, ABoxHasNoFaults) {
  const SurfaceFaults faults = surface_faults(box_mesh({1, 2, 3}));
  EXPECT_TRUE(faults.none());
  EXPECT_EQ(half_edges(box_mesh({1, 2, 3}), position_ids(box_mesh({1, 2, 3}))).size(), 36u);
}

TEST(MeshTopology, AHoleIsThreeOpenEdges) {
  TriangleMesh mesh = box_mesh({1, 2, 3});
  const Eigen::Vector3i gone = mesh.triangles.back();
  mesh.triangles.pop_back();
  const SurfaceFaults faults = surface_faults(mesh);
  EXPECT_EQ(faults.open.count, 3u);
  EXPECT_EQ(faults.open.triangles, 1);
  EXPECT_EQ(faults.odd.count + faults.unbalanced.count + faults.points, 0u);
  int corners_of_the_hole = 0;
  for (int k = 0; k < 3; ++k) {
    corners_of_the_hole +=
        mesh.vertices[gone[k]] == faults.open.from || mesh.vertices[gone[k]] == faults.open.to ? 1 : 0;
  }
  EXPECT_EQ(corners_of_the_hole, 2);
}

TEST(MeshTopology, AFlippedTriangleIsThreeUnbalancedEdgesAndIsTurnedBack) {
  TriangleMesh mesh = box_mesh({1, 2, 3});
  std::swap(mesh.triangles[7][0], mesh.triangles[7][1]);
  EXPECT_EQ(surface_faults(mesh).unbalanced.count, 3u);
  EXPECT_FALSE(is_closed(mesh));
  EXPECT_NEAR(repaired_volume(mesh), 6.0, 1e-12);
}

TEST(MeshTopology, AWallInsideMakesOddEdges) {
  TriangleMesh mesh = joined(box_mesh({1, 1, 1}), translated(box_mesh({1, 1, 1}), {1, 0, 0}));
  // The two boxes have a face each in the plane between them: closed, their volumes add up.
  EXPECT_TRUE(is_closed(mesh));
  EXPECT_NEAR(volume(mesh), 2.0, 1e-12);
  mesh.triangles.erase(std::find_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const Eigen::Vector3i& t) {
    return mesh.vertices[t[0]].x() == 0.5 && mesh.vertices[t[1]].x() == 0.5 && mesh.vertices[t[2]].x() == 0.5;
  }));
  const SurfaceFaults faults = surface_faults(mesh);
  EXPECT_EQ(faults.odd.count + faults.open.count, 3u);
  EXPECT_GE(faults.odd.count, 2u);
  EXPECT_EQ(faults.odd.triangles, 3);
}

TEST(MeshTopology, BoxesThatTouchAlongAnEdgeAreClosed) {
  const TriangleMesh mesh = joined(box_mesh({1, 1, 1}), translated(box_mesh({1, 1, 1}), {1, 1, 0}));
  EXPECT_TRUE(is_closed(mesh));
  Rng rng = make_rng(1);
  EXPECT_NEAR(repaired_volume(shuffled_winding(mesh, rng)), 2.0, 1e-12);
  EXPECT_EQ(wound_consistently(mesh)->shells.count, 2);
}

TEST(MeshTopology, TrianglesThatAreThereTwiceAreDropped) {
  const TriangleMesh box = box_mesh({1, 2, 3});
  const TriangleMesh twice = joined(box, box);
  EXPECT_EQ(without_repeated_triangles(twice).triangles, box.triangles);
  TriangleMesh rotated_corners = box;
  for (const Eigen::Vector3i& t : box.triangles) rotated_corners.triangles.emplace_back(t[1], t[2], t[0]);
  EXPECT_EQ(without_repeated_triangles(rotated_corners).triangles, box.triangles);
  // One that faces the other way is another triangle.
  EXPECT_EQ(without_repeated_triangles(joined(box, inside_out(box))).triangles.size(), 24u);
}

TEST(MeshTopology, RandomWindingIsRepairedOutwards) {
  Rng rng = make_rng(2);
  for (int i = 0; i < 20; ++i) {
    EXPECT_NEAR(repaired_volume(shuffled_winding(sphere_mesh(1.0), rng)), volume(sphere_mesh(1.0)), 1e-12);
  }
}

TEST(MeshTopology, ShellsThatAreInsideOutAreTurnedUnlessTheyAreCavities) {
  const TriangleMesh outer = box_mesh({4, 4, 4}), inner = box_mesh({1, 1, 1}),
                     beside = translated(box_mesh({2, 2, 2}), {10, 0, 0});
  EXPECT_NEAR(repaired_volume(joined(outer, inside_out(inner))), 63.0, 1e-12);
  EXPECT_NEAR(repaired_volume(joined(inside_out(outer), inner)), 63.0, 1e-12);
  EXPECT_NEAR(repaired_volume(joined(outer, inside_out(beside))), 72.0, 1e-12);
  EXPECT_NEAR(repaired_volume(joined(inside_out(outer), beside)), 72.0, 1e-12);
  EXPECT_NEAR(repaired_volume(joined(inside_out(outer), inside_out(beside))), 72.0, 1e-12);
  // Solids that were outward stay so wherever they lie: they may be parts that overlap.
  EXPECT_NEAR(repaired_volume(joined(outer, inner)), 65.0, 1e-12);
  // Wound at random, only the place tells a cavity.
  Rng rng = make_rng(3);
  for (int i = 0; i < 10; ++i) {
    EXPECT_NEAR(repaired_volume(shuffled_winding(joined(joined(outer, inner), beside), rng)), 71.0, 1e-12);
  }
}

TEST(MeshTopology, AOneSidedSurfaceCannotBeWound) {
  // Klein's bottle as a grid whose last column meets the first upside down; where it lies does not matter.
  constexpr int kN = 6;
  Rng rng = make_rng(4);
  TriangleMesh mesh;
  for (int i = 0; i < kN * kN; ++i) mesh.vertices.push_back(normal3(rng));
  const auto corner = [](int i, int j) { return i == kN ? (kN - j % kN) % kN : i * kN + j % kN; };
  for (int i = 0; i < kN; ++i) {
    for (int j = 0; j < kN; ++j) {
      mesh.triangles.emplace_back(corner(i, j), corner(i + 1, j), corner(i + 1, j + 1));
      mesh.triangles.emplace_back(corner(i, j), corner(i + 1, j + 1), corner(i, j + 1));
    }
  }
  EXPECT_EQ(surface_faults(mesh).open.count, 0u);
  EXPECT_FALSE(wound_consistently(mesh).has_value());
}

}  // namespace
}  // namespace dofusion
