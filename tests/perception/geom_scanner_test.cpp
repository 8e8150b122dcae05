#include "perception/geom_scanner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "perception/geom_rays.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

constexpr double kExact = 1e-12;  // formulas in double, at coordinates around one metre
constexpr double kFloat = 1e-7;   // depth images are of floats, around one metre

const Camera kCamera{500.0, 500.0, 100.0, 80.0, 201, 161, 1.0};

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

// One metre above z = 0, looking straight down, image x along world x.
Pose overhead() { return make_pose(Vector3d(1, -1, -1).asDiagonal().toDenseMatrix(), {0, 0, 1}); }

Geom geom(GeomType type, const Vector3d& size, int body = 0) {
  Geom result;
  result.type = type;
  result.size = size;
  result.body = body;
  return result;
}

Geom mesh_geom(const TriangleMesh& mesh, int body = 0) {
  Geom result = geom(GeomType::kMesh, Vector3d::Zero(), body);
  result.mesh = std::make_shared<TriangleMesh>(mesh);
  return result;
}

// Rows along y, columns along x: a step from 0 to 0.1 m between x = 0 and x = 0.2.
Geom landscape() {
  Geom result = geom(GeomType::kHeightField, Vector3d::Zero());
  result.height_field =
      std::make_shared<HeightField>(HeightField{2, 3, {0.2, 0.1}, 0.05, {0.0f, 0.0f, 0.1f, 0.0f, 0.0f, 0.1f}});
  return result;
}

void expect_hit(GeomType type, const Vector3d& size, const Vector3d& origin, const Vector3d& direction, double along,
                const Vector3d& normal) {
  const auto hit = intersect(type, size, origin, direction);
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->along, along, kExact);
  EXPECT_LT((hit->normal - normal.normalized()).norm(), kExact);
}

TEST(GeomRays, PlanesAreSeenFromTheirFrontWithinTheirSize) {
  expect_hit(GeomType::kPlane, {0, 0, 1}, {3, 4, 2}, {0, 0, -0.5}, 4.0, {0, 0, 1});
  expect_hit(GeomType::kPlane, {0, 0.1, 1}, {1e6, 0, 1}, {0, 0, -1}, 1.0, {0, 0, 1});  // no end along x
  EXPECT_FALSE(intersect(GeomType::kPlane, {0, 0.1, 1}, {0, 0.2, 1}, {0, 0, -1}));
  EXPECT_FALSE(intersect(GeomType::kPlane, {0, 0, 1}, {0, 0, -1}, {0, 0, 1}));  // from behind
  EXPECT_FALSE(intersect(GeomType::kPlane, {0, 0, 1}, {0, 0, 1}, {1, 0, 0}));   // along it
  EXPECT_FALSE(intersect(GeomType::kPlane, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}));   // away
}

TEST(GeomRays, Spheres) {
  // At a height of 0.6 of the radius the half chord is 0.8 of it.
  expect_hit(GeomType::kSphere, {0.5, 0, 0}, {-2, 0, 0.3}, {2, 0, 0}, 0.8, {-0.4, 0, 0.3});
  expect_hit(GeomType::kSphere, {0.5, 0, 0}, {0, 0, 0.3}, {1, 0, 0}, 0.4, {0.4, 0, 0.3});  // from inside: its far side
  EXPECT_FALSE(intersect(GeomType::kSphere, {0.5, 0, 0}, {-2, 0, 0.51}, {1, 0, 0}));
  EXPECT_FALSE(intersect(GeomType::kSphere, {0.5, 0, 0}, {2, 0, 0}, {1, 0, 0}));  // behind the ray
}

// Inside is where the ray that leaves comes out with its normal along it, and only there.
TEST(GeomRays, ContainsWhatRaysLeave) {
  std::mt19937_64 engine(5);
  std::uniform_real_distribution<double> size(0.05, 1.0), place(-1.2, 1.2);
  for (const GeomType type : {GeomType::kSphere, GeomType::kCapsule, GeomType::kEllipsoid, GeomType::kCylinder,
                              GeomType::kBox, GeomType::kPlane}) {
    int inside = 0;
    for (int i = 0; i < 5000; ++i) {
      const Vector3d own(size(engine), size(engine), size(engine)), point(place(engine), place(engine), place(engine));
      const Vector3d direction(place(engine), place(engine), place(engine));
      const auto hit = intersect(type, own, point, direction);
      const bool leaves = hit && hit->normal.dot(direction) > 0.0;
      inside += leaves ? 1 : 0;
      EXPECT_EQ(contains(type, own, point), leaves) << static_cast<int>(type) << " at " << point.transpose();
    }
    EXPECT_EQ(inside > 100, type != GeomType::kPlane);
  }
}

TEST(GeomRays, FarOriginsCostNoDigits) {
  const auto hit = intersect(GeomType::kSphere, {0.01, 0, 0}, {-1e4, 0, 0.006}, {1, 0, 0});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->along, 1e4 - 0.008, 1e-10);  // of 1e4 m a double resolves 2e-12 m
}

TEST(GeomRays, Capsules) {
  const Vector3d size(0.1, 0.3, 0);
  expect_hit(GeomType::kCapsule, size, {1, 0, 0.2}, {-1, 0, 0}, 0.9, {1, 0, 0});
  expect_hit(GeomType::kCapsule, size, {0, 0, 1}, {0, 0, -1}, 0.6, {0, 0, 1});
  expect_hit(GeomType::kCapsule, size, {1, 0, 0.36}, {-1, 0, 0}, 0.92, {0.08, 0, 0.06});  // the cap: 6, 8, 10
  expect_hit(GeomType::kCapsule, size, {0, 0, 0}, {0, 0, -1}, 0.4, {0, 0, -1});           // from inside
  EXPECT_FALSE(intersect(GeomType::kCapsule, size, {1, 0, 0.41}, {-1, 0, 0}));
}

TEST(GeomRays, Ellipsoids) {
  const Vector3d size(0.5, 0.2, 0.1);
  expect_hit(GeomType::kEllipsoid, size, {2, 0, 0}, {-1, 0, 0}, 1.5, {1, 0, 0});
  // At x = 0.3 the section's height is 0.8 of 0.1; the gradient there is (x/a2, 0, z/c2).
  expect_hit(GeomType::kEllipsoid, size, {0.3, 0, 1}, {0, 0, -1}, 0.92, {0.3 / 0.25, 0, 0.08 / 0.01});
  EXPECT_FALSE(intersect(GeomType::kEllipsoid, size, {0, 0.21, 1}, {0, 0, -1}));
}

TEST(GeomRays, Cylinders) {
  const Vector3d size(0.1, 0.3, 0);
  expect_hit(GeomType::kCylinder, size, {1, 0.06, 0.2}, {-1, 0, 0}, 0.92, {0.08, 0.06, 0});
  expect_hit(GeomType::kCylinder, size, {0.05, 0, 1}, {0, 0, -1}, 0.7, {0, 0, 1});
  expect_hit(GeomType::kCylinder, size, {0.05, 0, 0}, {0, 0, -1}, 0.3, {0, 0, -1});  // from inside
  EXPECT_FALSE(intersect(GeomType::kCylinder, size, {0.11, 0, 1}, {0, 0, -1}));
  EXPECT_FALSE(intersect(GeomType::kCylinder, size, {1, 0, 0.31}, {-1, 0, 0}));
}

TEST(GeomRays, Boxes) {
  const Vector3d size(0.1, 0.2, 0.3);
  expect_hit(GeomType::kBox, size, {1, 0.19, 0.29}, {-1, 0, 0}, 0.9, {1, 0, 0});
  expect_hit(GeomType::kBox, size, {0, -1, 0}, {0, 2, 0}, 0.4, {0, -1, 0});
  expect_hit(GeomType::kBox, size, {0, 0, 0}, {0, 0, 1}, 0.3, {0, 0, 1});          // from inside
  expect_hit(GeomType::kBox, size, {0.4, 0, 0.4}, {-1, 0, -0.5}, 0.3, {1, 0, 0});  // by way of z = 0.25
  EXPECT_FALSE(intersect(GeomType::kBox, size, {1, 0.21, 0}, {-1, 0, 0}));
  EXPECT_FALSE(intersect(GeomType::kBox, size, {1, 0, 0}, {1, 0, 0}));
}

TEST(GeomScanner, DepthLabelsAndNormalsOfEveryType) {
  // Side by side on a plane, 0.2 m apart, tops at heights 0.05 to 0.1.
  std::vector<Geom> geoms{geom(GeomType::kPlane, {0, 0, 1}),
                          geom(GeomType::kSphere, {0.05, 0, 0}, 1),
                          geom(GeomType::kCapsule, {0.02, 0.03, 0}, 2),
                          geom(GeomType::kEllipsoid, {0.03, 0.03, 0.04}, 3),
                          geom(GeomType::kCylinder, {0.03, 0.025, 0}, 4),
                          geom(GeomType::kBox, {0.03, 0.03, 0.03}, 5),
                          mesh_geom(box_mesh({0.06, 0.06, 0.07}), 6)};
  const std::vector<double> half_heights{0, 0.05, 0.05, 0.04, 0.025, 0.03, 0.035};
  std::vector<Pose> poses{Pose::Identity()};
  for (std::size_t i = 1; i < geoms.size(); ++i) poses.push_back(at(0.2 * static_cast<double>(i), 0, half_heights[i]));
  GeomScanner scanner(geoms);
  scanner.set_poses(poses);
  for (std::size_t i = 1; i < geoms.size(); ++i) {
    const Pose T_world_camera = at(0.2 * static_cast<double>(i), 0, 0) * overhead();
    const GeomScan scan = scanner.render(kCamera, T_world_camera);
    EXPECT_NEAR(scan.depth.at(80, 100), 1.0 - 2.0 * half_heights[i], kFloat) << i;
    EXPECT_EQ(scan.geoms.at(80, 100), static_cast<int>(i));
    EXPECT_EQ(scan.bodies.at(80, 100), static_cast<int>(i));
    EXPECT_LT((scan.normals.at(80, 100) - Eigen::Vector3f(0, 0, -1)).norm(), 1e-6f) << i;
    EXPECT_EQ(scan.geoms.at(0, 100), 0);  // the plane, without end
    EXPECT_NEAR(scan.depth.at(0, 100), 1.0, kFloat);
  }
}

TEST(GeomScanner, HeightFieldsAreClosed) {
  const TriangleMesh mesh = height_field_mesh(*landscape().height_field);
  EXPECT_TRUE(is_closed(mesh));
  EXPECT_NEAR(volume(mesh), 0.4 * 0.2 * 0.05 + 0.5 * 0.2 * 0.1 * 0.2, 1e-9);
  const GeomScanner scanner({landscape()});
  const auto slope = scanner.cast_ray({0.05, 0.02, 1}, {0, 0, -1});
  ASSERT_TRUE(slope);
  EXPECT_NEAR(slope->distance, 1.0 - 0.025, 1e-8);  // heights are floats
  EXPECT_LT((slope->normal - Vector3d(-1, 0, 2).normalized()).norm(), 1e-7);
  const auto wall = scanner.cast_ray({1, 0, 0.09}, {-1, 0, 0});
  ASSERT_TRUE(wall);
  EXPECT_NEAR(wall->distance, 0.8, kExact);
  const auto bottom = scanner.cast_ray({-0.1, 0.03, -1}, {0, 0, 1});
  ASSERT_TRUE(bottom);
  EXPECT_NEAR(bottom->distance, 0.95, kExact);
}

TEST(GeomScanner, NearestOfManyIsSeenAndPosesMove) {
  GeomScanner scanner({geom(GeomType::kPlane, {0, 0, 1}), geom(GeomType::kSphere, {0.1, 0, 0}, 1),
                       geom(GeomType::kBox, {0.05, 0.05, 0.05}, 2)});
  scanner.set_poses({Pose::Identity(), at(0, 0, 0.1), at(0, 0, 0.4)});
  EXPECT_EQ(scanner.cast_ray({0, 0, 1}, {0, 0, -3})->body, 2);
  EXPECT_NEAR(scanner.cast_ray({0, 0, 1}, {0, 0, -3})->distance, 0.55, kExact);
  scanner.set_poses({Pose::Identity(), at(0, 0, 0.1), at(1, 0, 0.4)});
  EXPECT_NEAR(scanner.cast_ray({0, 0, 1}, {0, 0, -3})->distance, 0.8, kExact);
  EXPECT_EQ(scanner.cast_ray({1, 0, 1}, {0, 0, -1})->geom, 2);
  scanner.set_poses({at(0, 0, 0.9), at(0, 0, 0.1), at(1, 0, 0.4)});
  EXPECT_EQ(scanner.cast_ray({0, 0, 1}, {0, 0, -1})->geom, 0);
  EXPECT_FALSE(scanner.cast_ray({0, 0, 1}, {0, 0, 1}));
}

TEST(GeomScanner, GroupsAlphaAndSingleGeomsAreHidden) {
  std::vector<Geom> geoms{geom(GeomType::kSphere, {0.1, 0, 0}), geom(GeomType::kSphere, {0.2, 0, 0}),
                          geom(GeomType::kSphere, {0.3, 0, 0}), geom(GeomType::kPlane, {0, 0, 0})};
  geoms[1].group = 3;
  geoms[2].rgba[3] = 0.0f;
  geoms[3].group = 4;
  GeomScanner scanner(geoms);
  EXPECT_EQ(scanner.cast_ray({0, 0, 1}, {0, 0, -1})->geom, 0);
  EXPECT_FALSE(scanner.cast_ray({1, 0, 1}, {0, 0, -1}));
  scanner.set_group_visible(3, true);
  EXPECT_EQ(scanner.cast_ray({0, 0, 1}, {0, 0, -1})->geom, 1);
  scanner.set_visible(1, false);
  EXPECT_EQ(scanner.cast_ray({0, 0, 1}, {0, 0, -1})->geom, 0);
  scanner.set_group_visible(0, false);
  EXPECT_FALSE(scanner.cast_ray({0, 0, 1}, {0, 0, -1}));
  scanner.set_group_visible(4, true);
  EXPECT_EQ(scanner.cast_ray({0, 0, 1}, {0, 0, -1})->geom, 3);
}

TEST(GeomScanner, MoreGeomsThanLabelsAndAnyNumberOfThreads) {
  std::vector<Geom> geoms;
  for (int i = 0; i < 400; ++i) {
    geoms.push_back(geom(i % 2 == 0 ? GeomType::kSphere : GeomType::kBox, {0.004, 0.004, 0.004}));
    geoms.back().T_body_geom = at(-0.19 + 0.02 * (i % 20), -0.19 + 0.02 * (i / 20), 0);
  }
  const GeomScanner scanner(geoms);
  const GeomScan one = scanner.render(kCamera, overhead(), 1), three = scanner.render(kCamera, overhead(), 3);
  EXPECT_GT(*std::max_element(one.geoms.pixels.begin(), one.geoms.pixels.end()), 255);
  EXPECT_EQ(one.geoms.pixels, three.geoms.pixels);
  EXPECT_EQ(one.depth.pixels, three.depth.pixels);
  EXPECT_EQ(one.normals.pixels, three.normals.pixels);
}

TEST(GeomScanner, SegmentsAreOccluded) {
  const GeomScanner scanner({geom(GeomType::kPlane, {0.1, 0.1, 1}), geom(GeomType::kSphere, {0.05, 0, 0})});
  const std::vector<std::uint8_t> hidden = scanner.occluded({{{0, 0, 1}, {0, 0, 0.06f}},
                                                             {{0, 0, 1}, {0, 0, 0.04f}},
                                                             {{0.08f, 0, 1}, {0.08f, 0, -1}},
                                                             {{0.2f, 0, 1}, {0.2f, 0, -1}}});
  EXPECT_EQ(hidden, (std::vector<std::uint8_t>{0, 1, 1, 0}));
}

TEST(GeomScanner, LabelsOfBodiesAndIncidence) {
  GeomScanner scanner({geom(GeomType::kPlane, {0.05, 0.05, 1}), geom(GeomType::kSphere, {0.02, 0, 0}, 1)});
  const GeomScan scan = scanner.render(kCamera, overhead());
  const Scan labels = labelled(scan, {kLabelTable, 7});
  EXPECT_EQ(labels.labels.at(80, 100), 7);
  EXPECT_EQ(labels.labels.at(80, 120), kLabelTable);  // 0.04 m beside the centre
  EXPECT_EQ(labels.labels.at(80, 150), kLabelNothing);
  EXPECT_THROW(labelled(scan, {kLabelTable}), std::invalid_argument);
  const AngleImage angles = incidence_angles(scan.normals, kCamera);
  EXPECT_NEAR(angles.at(80, 100), 0.0, 1e-6);
  EXPECT_NEAR(angles.at(80, 120), std::atan(0.04), 1e-6);
  EXPECT_EQ(angles.at(80, 150), 0.0f);
}

TEST(GeomScanner, CameraOfAFieldOfView) {
  const Camera camera = camera_of_fovy(M_PI / 2, 640, 480);
  EXPECT_NEAR(camera.fx, 240.0, 1e-9);
  EXPECT_NEAR(camera.fy, 240.0, 1e-9);
  EXPECT_EQ(camera.cx, 319.5);
  EXPECT_EQ(camera.cy, 239.5);
  EXPECT_THROW(camera_of_fovy(0.0, 640, 480), std::invalid_argument);
  EXPECT_THROW(camera_of_fovy(M_PI, 640, 480), std::invalid_argument);
  EXPECT_THROW(camera_of_fovy(1.0, 0, 480), std::invalid_argument);
}

TEST(GeomScanner, CallersMistakesThrow) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(GeomScanner({geom(GeomType::kSphere, {0, 0, 0})}), std::invalid_argument);
  EXPECT_THROW(GeomScanner({geom(GeomType::kBox, {1, nan, 1})}), std::invalid_argument);
  EXPECT_THROW(GeomScanner({geom(GeomType::kMesh, {1, 1, 1})}), std::invalid_argument);
  EXPECT_THROW(GeomScanner({geom(GeomType::kHeightField, {1, 1, 1})}), std::invalid_argument);
  EXPECT_THROW(GeomScanner({geom(GeomType::kSphere, {1, 1, 1}, -1)}), std::invalid_argument);
  EXPECT_THROW(GeomScanner({mesh_geom({{{0, 0, 0}}, {{0, 1, 2}}})}), std::invalid_argument);
  GeomScanner scanner({geom(GeomType::kSphere, {1, 1, 1}, 1)});
  EXPECT_THROW(scanner.set_poses({Pose::Identity()}), std::invalid_argument);
  EXPECT_THROW(scanner.set_poses({Pose::Identity(), at(nan, 0, 0)}), std::invalid_argument);
  EXPECT_THROW(scanner.set_visible(1, true), std::invalid_argument);
  EXPECT_THROW(scanner.set_group_visible(6, true), std::invalid_argument);
  EXPECT_THROW(scanner.render({}, overhead()), std::invalid_argument);
  EXPECT_THROW(scanner.cast_ray({0, 0, 0}, {0, 0, 0}), std::invalid_argument);
  EXPECT_FALSE(GeomScanner({}).cast_ray({0, 0, 0}, {0, 0, 1}));
}

}  // namespace
}  // namespace dofusion
