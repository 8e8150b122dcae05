#include "stability/mesh.h"

#include <gtest/gtest.h>

#include "stability/convex_hull.h"
#include "stability/scene.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

TEST(Mesh, BoxHasItsVolumeAreaAndDiameter) {
  const TriangleMesh box = translated(box_mesh({1, 2, 3}), {5, -7, 11});
  EXPECT_NEAR(volume(box), 6.0, 1e-12);
  EXPECT_NEAR(surface_area(box), 22.0, 1e-12);
  EXPECT_NEAR(diameter(box), std::sqrt(14.0), 1e-12);
  EXPECT_LT((centre_of_mass(box) - Vector3d(5, -7, 11)).norm(), 1e-12);
  EXPECT_TRUE(is_closed(box));
  EXPECT_TRUE(is_convex(box));
}

TEST(Mesh, WithAHoleOrAFlippedTriangleIsNotClosed) {
  TriangleMesh hole = box_mesh({1, 1, 1});
  hole.triangles.pop_back();
  EXPECT_FALSE(is_closed(hole));
  TriangleMesh flipped = box_mesh({1, 1, 1});
  std::swap(flipped.triangles[0][0], flipped.triangles[0][1]);
  EXPECT_FALSE(is_closed(flipped));
  EXPECT_FALSE(is_closed({}));
}

TEST(Mesh, WithVerticesPerFaceIsClosedAndWelds) {
  const TriangleMesh box = box_mesh({1, 1, 1});
  TriangleMesh soup;
  for (const auto& t : box.triangles) {
    const int first = static_cast<int>(soup.vertices.size());
    for (int k = 0; k < 3; ++k) soup.vertices.push_back(box.vertices[t[k]]);
    soup.triangles.emplace_back(first, first + 1, first + 2);
  }
  EXPECT_TRUE(is_closed(soup));
  EXPECT_EQ(weld(soup).vertices.size(), 8u);
}

TEST(Mesh, NotchedPrismIsNotConvex) {
  const TriangleMesh notched = prism_mesh({{0, 0}, {2, 0}, {1, 0.5}, {2, 2}, {0, 2}}, 0, 1);
  EXPECT_FALSE(is_convex(notched));
}

TEST(Mesh, SurfaceSamplesLieOnTheBoxAndFollowItsAreas) {
  const TriangleMesh box = box_mesh({1, 2, 3});
  Rng rng = make_rng(4);
  const int n = 20000;
  int on_large_faces = 0;  // the two faces of 2 x 3 hold 12 of the area of 22
  for (const SurfaceSample& s : sample_surface(box, n, rng)) {
    const Vector3d q = s.point.cwiseAbs() - Vector3d(0.5, 1.0, 1.5);
    EXPECT_NEAR(q.maxCoeff(), 0.0, 1e-12);
    EXPECT_GT(s.normal.dot(s.point), 0.0);
    on_large_faces += std::abs(s.normal.x()) > 0.5 ? 1 : 0;
  }
  const double p = 12.0 / 22.0;
  EXPECT_NEAR(on_large_faces / static_cast<double>(n), p, 5.0 * std::sqrt(p * (1 - p) / n));
}

TEST(ConvexHull, OfABoxAndPointsInsideIsTheBox) {
  std::vector<Vector3d> points = box_mesh({1, 2, 3}).vertices;
  Rng rng = make_rng(5);
  for (int i = 0; i < 100; ++i) {
    const double x = uniform(rng, -0.4, 0.4), y = uniform(rng, -0.9, 0.9), z = uniform(rng, -1.4, 1.4);
    points.emplace_back(x, y, z);
  }
  const TriangleMesh hull = convex_hull(points);
  EXPECT_EQ(hull.vertices.size(), 8u);
  EXPECT_EQ(hull.triangles.size(), 12u);
  EXPECT_TRUE(is_closed(hull));
  EXPECT_NEAR(volume(hull), 6.0, 1e-12);
}

TEST(ConvexHull, OfFlatOrBadPointsThrows) {
  EXPECT_THROW(convex_hull({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}), std::invalid_argument);
  EXPECT_THROW(convex_hull({{0, 0, 0}, {1, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(convex_hull({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, std::nan("")}}), std::invalid_argument);
}

TEST(MakeObject, MovesTheOriginToTheCentreOfMassAndKnowsBoxes) {
  const ObjectAndOffset box = make_object("b", translated(box_mesh({1, 2, 3}), {4, 5, 6}));
  EXPECT_LT((box.origin - Vector3d(4, 5, 6)).norm(), 1e-12);
  ASSERT_TRUE(box.object->box_edges.has_value());
  EXPECT_LT((*box.object->box_edges - Vector3d(1, 2, 3)).norm(), 1e-9);
  EXPECT_FALSE(make_block("hat")->box_edges.has_value());
}

TEST(MakeObject, RefusesOpenEmptyAndNonFiniteMeshes) {
  TriangleMesh open = box_mesh({1, 1, 1});
  open.triangles.pop_back();
  EXPECT_THROW(make_object("open", open), std::invalid_argument);
  EXPECT_THROW(make_object("empty", {}), std::invalid_argument);
  TriangleMesh bad = box_mesh({1, 1, 1});
  bad.vertices[0].x() = std::nan("");
  EXPECT_THROW(make_object("nan", bad), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
