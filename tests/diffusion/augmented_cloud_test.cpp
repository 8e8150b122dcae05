#include "diffusion/augmented_cloud.h"

#include <cmath>

#include <gtest/gtest.h>

#include "stability/shapes.h"

namespace dofusion {
namespace {

// Coordinates of single precision at a few decimetres: an error of some 1e-7 m.
constexpr double kTolerance = 5e-7;

std::vector<float> cloud_of(const Scene& scene, int query, const CloudOptions& options, std::uint64_t seed = 0) {
  std::vector<CloudShapePtr> shapes;
  for (const ObjectPtr& object : scene.objects) shapes.push_back(std::make_shared<CloudShape>(*object));
  std::vector<float> cloud(static_cast<std::size_t>(options.points) * kCloudChannels);
  Rng rng = make_rng(seed);
  make_augmented_cloud(shapes, scene.T_world_object, query, options, rng, cloud.data());
  return cloud;
}

Scene two_cubes(double gap) {
  Scene scene;
  scene.objects = {make_block("cube"), make_block("cube")};
  scene.T_world_object = {make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.025}),
                          make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.075 + gap})};
  return scene;
}

TEST(AugmentedCloud, NormalisedLengthIsTheGeometricMean) {
  EXPECT_NEAR(normalised_length({0.001}), 0.1, 1e-12);
  EXPECT_NEAR(normalised_length({0.001, 0.000001}), std::cbrt(std::sqrt(1e-9)), 1e-12);
  EXPECT_THROW(normalised_length({}), std::invalid_argument);
  EXPECT_THROW(normalised_length({0.0}), std::invalid_argument);
}

TEST(AugmentedCloud, DistanceOfStackedCubesIsTheirGap) {
  CloudOptions options;
  options.points = 400;
  options.length = 0.05;
  options.distance_limit = 10.0;
  const double gap = 0.01;
  const std::vector<float> cloud = cloud_of(two_cubes(gap), 1, options);
  double least = 1e9;
  for (int i = 0; i < options.points; ++i) {
    const float* p = &cloud[kCloudChannels * i];
    const double z = p[2] * options.length, distance = p[3] * options.length;
    // Both cubes have the same x and y extent, so the distance of any point is that along z to the other's face.
    const bool query = p[4] == 1.0f;
    EXPECT_NEAR(distance, query ? z - 0.05 : 0.05 + gap - z, kTolerance);
    EXPECT_EQ(query, i >= 200);
    least = std::min(least, distance);
  }
  EXPECT_NEAR(least, gap, 1e-6);  // some points lie on the facing sides
}

TEST(AugmentedCloud, OverlapIsNegativeAndClamped) {
  CloudOptions options;
  options.points = 200;
  options.length = 0.05;
  options.distance_limit = 0.2;
  const std::vector<float> cloud = cloud_of(two_cubes(-0.02), 1, options);
  float low = 1, high = -1;
  for (int i = 0; i < options.points; ++i) {
    low = std::min(low, cloud[kCloudChannels * i + 3]);
    high = std::max(high, cloud[kCloudChannels * i + 3]);
  }
  EXPECT_LT(low, 0.0f);
  EXPECT_FLOAT_EQ(high, 0.2f);
}

TEST(AugmentedCloud, AloneTheDistanceIsTheLimitAndPointsLieOnTheSurface) {
  Scene scene;
  Rng rng = make_rng(4);
  const ObjectPtr hat = make_block("hat");
  const Pose pose = make_pose(random_rotation(rng), {0.3, -0.2, 0.1});
  scene.objects = {hat};
  scene.T_world_object = {pose};
  CloudOptions options;
  options.length = 0.04;
  options.origin = {0.3, -0.2, 0.0};
  const std::vector<float> cloud = cloud_of(scene, 0, options);
  const MeshDistance distance(hat->mesh);
  for (int i = 0; i < options.points; ++i) {
    const Eigen::Vector3d p_world =
        Eigen::Vector3d(cloud[kCloudChannels * i], cloud[kCloudChannels * i + 1], cloud[kCloudChannels * i + 2]) * options.length + options.origin;
    EXPECT_NEAR(distance(pose.inverse() * p_world), 0.0, kTolerance);
    EXPECT_EQ(cloud[kCloudChannels * i + 3], 1.0f);
    EXPECT_EQ(cloud[kCloudChannels * i + 4], 1.0f);
  }
}

TEST(AugmentedCloud, RemainderGoesToTheQuery) {
  Scene scene = two_cubes(0.0);
  scene.objects.push_back(make_block("hat"));
  scene.T_world_object.push_back(make_pose(Eigen::Matrix3d::Identity(), {0.2, 0, 0.1}));
  CloudOptions options;
  options.points = 100;
  const std::vector<float> cloud = cloud_of(scene, 1, options);
  int flagged = 0;
  for (int i = 0; i < 100; ++i) flagged += cloud[kCloudChannels * i + 4] == 1.0f;
  EXPECT_EQ(flagged, 34);
}

TEST(AugmentedCloud, SeedRepeats) {
  EXPECT_EQ(cloud_of(two_cubes(0.01), 0, {}, 7), cloud_of(two_cubes(0.01), 0, {}, 7));
  EXPECT_NE(cloud_of(two_cubes(0.01), 0, {}, 7), cloud_of(two_cubes(0.01), 0, {}, 8));
}

// The vectorised distances of boxes and of convex meshes against the exact ones in double precision.
TEST(CloudShape, DistanceAgreesWithTheExactOne) {
  Rng rng = make_rng(5);
  std::vector<ObjectPtr> objects = all_blocks();
  objects.push_back(make_box("plank", {0.3, 0.05, 0.02}));
  for (const ObjectPtr& object : objects) {
    const MeshDistance exact(object->mesh);
    const CloudShape shape(*object), as_mesh(object->mesh, std::nullopt);
    const int count = 500;
    std::vector<float> x(count), y(count), z(count), fast(count, 1e9f), mesh(count, 1e9f);
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d p = normal3(rng, 0.5 * object->diameter);
      x[i] = static_cast<float>(p.x());
      y[i] = static_cast<float>(p.y());
      z[i] = static_cast<float>(p.z());
    }
    const ConstColumns points{x.data(), y.data(), z.data()};
    std::vector<float> dx(count), dy(count), dz(count), mx(count), my(count), mz(count);
    shape.signed_distance(count, points, fast.data(), {dx.data(), dy.data(), dz.data()});
    as_mesh.signed_distance(count, points, mesh.data(), {mx.data(), my.data(), mz.data()});
    for (int i = 0; i < count; ++i) {
      const double wanted = exact(Eigen::Vector3d(x[i], y[i], z[i]));
      EXPECT_NEAR(fast[i], wanted, kTolerance) << object->name;
      EXPECT_NEAR(mesh[i], wanted, kTolerance) << object->name;
      // Along the direction the distance grows as fast as the point moves, away from where directions meet.
      const double step = 1e-6;
      const Eigen::Vector3d p(x[i], y[i], z[i]), along(dx[i], dy[i], dz[i]), along_mesh(mx[i], my[i], mz[i]);
      EXPECT_NEAR(along.norm(), 1.0, 1e-5);
      EXPECT_NEAR(along_mesh.norm(), 1.0, 1e-5);
      EXPECT_NEAR((exact(p + step * along) - wanted) / step, 1.0, 1e-2) << object->name;
      EXPECT_NEAR((exact(p + step * along_mesh) - wanted) / step, 1.0, 1e-2) << object->name;
    }
  }
}

TEST(CloudShape, DrawsUniformlyOverTheSurface) {
  const CloudShape plank(*make_box("plank", {0.2, 0.1, 0.02}));
  const int count = 20000;
  std::vector<float> x(count), y(count), z(count), nx(count), ny(count), nz(count);
  Rng rng = make_rng(6);
  plank.sample(count, 0.0, rng, {x.data(), y.data(), z.data()}, {nx.data(), ny.data(), nz.data()});
  int on_large_faces = 0;
  double sum_x = 0.0;
  for (int i = 0; i < count; ++i) {
    const bool large = std::abs(nz[i]) > 0.5f;
    EXPECT_NEAR(large ? nz[i] * z[i] : std::abs(nx[i]) > 0.5f ? nx[i] * x[i] : ny[i] * y[i],
                large ? 0.01 : std::abs(nx[i]) > 0.5f ? 0.1 : 0.05, 1e-6);  // outward
    on_large_faces += std::abs(std::abs(z[i]) - 0.01f) < 1e-7f;
    sum_x += x[i];
  }
  const double area = 2 * (0.2 * 0.1 + 0.2 * 0.02 + 0.1 * 0.02);
  EXPECT_NEAR(on_large_faces / double(count), 2 * 0.2 * 0.1 / area, 0.015);  // five standard errors
  EXPECT_NEAR(sum_x / count, 0.0, 0.0025);
}

TEST(CloudShape, PutsAShareOnCornersAndEdges) {
  const CloudShape plank(*make_box("plank", {0.2, 0.1, 0.02}));
  const int count = 4000, on_edges = 1000;
  std::vector<float> x(count), y(count), z(count), nx(count), ny(count), nz(count);
  Rng rng = make_rng(7);
  plank.sample(count, 0.25, rng, {x.data(), y.data(), z.data()}, {nx.data(), ny.data(), nz.data()});
  int along_x = 0;
  for (int i = 0; i < count; ++i) {
    const bool ends[3] = {std::abs(std::abs(x[i]) - 0.1f) < 1e-7f, std::abs(std::abs(y[i]) - 0.05f) < 1e-7f,
                          std::abs(std::abs(z[i]) - 0.01f) < 1e-7f};
    const int at = ends[0] + ends[1] + ends[2];
    EXPECT_EQ(at == 3, i < 8);  // each corner once
    EXPECT_EQ(at >= 2, i < on_edges);
    EXPECT_EQ(nx[i] == 0.0f && ny[i] == 0.0f && nz[i] == 0.0f, i < on_edges);
    along_x += i >= 8 && i < on_edges && !ends[0];
  }
  EXPECT_NEAR(along_x / 992.0, 0.2 / 0.32, 0.08);  // five standard errors

  const CloudShape ball(*make_sphere("ball", 0.05));
  ball.sample(count, 0.25, rng, {x.data(), y.data(), z.data()}, {nx.data(), ny.data(), nz.data()});
  EXPECT_GT(std::abs(nx[0]) + std::abs(ny[0]) + std::abs(nz[0]), 0.9f);  // it has no edges: all on its surface
}

}  // namespace
}  // namespace dofusion
