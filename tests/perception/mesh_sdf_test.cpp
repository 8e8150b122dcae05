#include "perception/mesh_sdf.h"

#include <cmath>

#include <gtest/gtest.h>

#include "stability/random.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Everything is computed in double from coordinates of some centimetres.
constexpr double kTolerance = 1e-12;

TriangleMesh sphere(double radius, int rings, int sectors) {
  TriangleMesh mesh;
  mesh.vertices.push_back({0, 0, radius});
  for (int r = 1; r < rings; ++r)
    for (int s = 0; s < sectors; ++s) {
      const double polar = kPi * r / rings, azimuth = 2 * kPi * s / sectors;
      mesh.vertices.push_back(radius * Eigen::Vector3d(std::sin(polar) * std::cos(azimuth),
                                                       std::sin(polar) * std::sin(azimuth), std::cos(polar)));
    }
  mesh.vertices.push_back({0, 0, -radius});
  const int last = static_cast<int>(mesh.vertices.size()) - 1;
  const auto index = [&](int r, int s) { return 1 + (r - 1) * sectors + s % sectors; };
  for (int s = 0; s < sectors; ++s) {
    mesh.triangles.push_back({0, index(1, s), index(1, s + 1)});
    for (int r = 1; r + 1 < rings; ++r) {
      mesh.triangles.push_back({index(r, s), index(r + 1, s), index(r + 1, s + 1)});
      mesh.triangles.push_back({index(r, s), index(r + 1, s + 1), index(r, s + 1)});
    }
    mesh.triangles.push_back({last, index(rings - 1, s + 1), index(rings - 1, s)});
  }
  return mesh;
}

// The solid angle of the mesh over 4 pi: 1 inside, 0 outside (Van Oosterom and Strackee 1983). Independent of
// nearest points and pseudonormals.
double winding_number(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  double solid_angle = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]] - p, b = mesh.vertices[t[1]] - p, c = mesh.vertices[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    solid_angle += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return solid_angle / (4.0 * kPi);
}

Eigen::Vector3d random_point(Rng& rng, double size) {
  return {uniform(rng, -size, size), uniform(rng, -size, size), uniform(rng, -size, size)};
}

TEST(MeshSdf, BoxIsTheClosedForm) {
  const Eigen::Vector3d edges(0.05, 0.08, 0.02);
  const MeshSdf distance(box_mesh(edges));
  Rng rng = make_rng(1);
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 0.1);
    EXPECT_NEAR(distance(p), box_signed_distance(edges, p), kTolerance) << p.transpose();
  }
}

TEST(MeshSdf, AgreesWithComparingAllTrianglesOnEveryBlock) {
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = block_mesh(name);
    const MeshSdf fast(mesh);
    const MeshDistance plain(mesh);
    Rng rng = make_rng(2);
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d p = random_point(rng, 0.12);
      EXPECT_NEAR(fast(p), plain(p), kTolerance) << name << " at " << p.transpose();
    }
  }
}

TEST(MeshSdf, SignIsRightBesideCornersAndEdges) {
  for (const std::string& name : block_names()) {
    const TriangleMesh mesh = block_mesh(name);
    const MeshSdf distance(mesh);
    Rng rng = make_rng(3);
    std::vector<Eigen::Vector3d> features = mesh.vertices;
    for (const Eigen::Vector3i& t : mesh.triangles)
      for (int k = 0; k < 3; ++k) {
        const double s = uniform(rng);
        features.push_back(s * mesh.vertices[t[k]] + (1.0 - s) * mesh.vertices[t[(k + 1) % 3]]);
      }
    for (const Eigen::Vector3d& feature : features)
      for (int i = 0; i < 50; ++i) {
        const Eigen::Vector3d p = feature + random_point(rng, 1e-4);
        if (std::abs(distance(p)) < 1e-9) continue;  // on the surface the winding number has no value
        EXPECT_EQ(distance(p) < 0.0, winding_number(mesh, p) > 0.5) << name << " at " << p.transpose();
      }
    EXPECT_GT(distance(Eigen::Vector3d(0, 0, 1)), 0.0) << name;
    EXPECT_LT(distance(Eigen::Vector3d::Zero()), 0.0) << name << ": its centre of mass is inside, it is convex";
  }
}

TEST(MeshSdf, SignIsRightInTheNotchOfAConcaveSolid) {
  // An L: a point in the notch is outside although it is inside the convex hull, and the concave edge is nearest to
  // points inside the solid.
  TriangleMesh mesh;
  const std::vector<Eigen::Vector2d> outline{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  const std::vector<Eigen::Vector3i> caps{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
  const int n = static_cast<int>(outline.size());
  for (double z : {0.0, 1.0})
    for (const Eigen::Vector2d& p : outline) mesh.vertices.push_back({p.x(), p.y(), z});
  for (const Eigen::Vector3i& t : caps) {
    mesh.triangles.push_back({t[0], t[2], t[1]});
    mesh.triangles.push_back(t + Eigen::Vector3i::Constant(n));
  }
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    mesh.triangles.push_back({i, j, j + n});
    mesh.triangles.push_back({i, j + n, i + n});
  }
  ASSERT_TRUE(is_closed(mesh));
  ASSERT_NEAR(volume(mesh), 3.0, 1e-12);
  const MeshSdf distance(mesh);
  EXPECT_NEAR(distance({1.2, 1.3, 0.5}), 0.2, kTolerance);
  EXPECT_NEAR(distance({0.9, 0.9, 0.5}), -std::sqrt(0.02), kTolerance);  // the concave edge is nearest
  Rng rng = make_rng(4);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 2.5);
    EXPECT_EQ(distance(p) < 0.0, winding_number(mesh, p) > 0.5) << p.transpose();
  }
}

TEST(MeshSdf, FineSphereIsASphere) {
  const double radius = 0.04;
  const TriangleMesh mesh = sphere(radius, 100, 200);
  const Eigen::Vector3d centre(3.0, -2.0, 1.0);  // far from the origin, where floats are coarse
  const MeshSdf distance(translated(mesh, centre));
  // A facet of angle a lies up to r a^2 / 8 below the sphere, a = 2 pi / 200 along both directions.
  const double sagitta = 2.0 * radius * std::pow(2.0 * kPi / 200, 2) / 8.0;
  const MeshDistance plain(mesh);
  Rng rng = make_rng(5);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 0.1);
    const double d = distance(centre + p);
    EXPECT_GE(d, p.norm() - radius - kTolerance);
    EXPECT_LE(d, p.norm() - radius + sagitta);
    if (i < 20) {
      EXPECT_NEAR(d, plain(p), kTolerance);  // slow, so only a few
    }
  }
}

TEST(MeshSdf, GridInterpolatesTheDistance) {
  const TriangleMesh mesh = block_mesh("hat");
  const SdfGrid grid = mesh_to_sdf_grid(mesh);
  const MeshDistance distance(mesh);
  Rng rng = make_rng(6);
  const double size = bounding_box(mesh).max.maxCoeff();
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = random_point(rng, 1.5 * size);
    // A distance has slope 1: interpolation errs by less than half a cell's diagonal, with the float's rounding.
    EXPECT_NEAR(grid(p), distance(p), 0.5 * std::sqrt(3.0) * grid.spacing + 1e-8);
  }
}

TEST(MeshSdf, OpenMeshesAreRefused) {
  TriangleMesh open = box_mesh({1, 1, 1});
  open.triangles.pop_back();
  EXPECT_THROW(MeshSdf{open}, std::invalid_argument);
  EXPECT_THROW(MeshSdf{TriangleMesh{}}, std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
