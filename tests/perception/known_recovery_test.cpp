#include "perception/known_recovery.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "perception/object_model.h"
#include "perception/segmentation.h"
#include "perception/synthetic_view.h"
#include "stability/convex_hull.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

struct SeenScene {
  Scene truth;
  Pose T_world_camera = Pose::Identity();
  std::vector<RecoveredObject> found;  // poses in the true world
  LabelImage labels;                   // of the found objects
};

// Renders the scene, segments it and recovers the blocks in it.
SeenScene see(const Scene& truth, double noise_scale, std::uint64_t seed, int threads = 1) {
  SeenScene seen;
  seen.truth = truth;
  Rng rng = make_rng(seed);
  const Camera camera = default_camera();
  SyntheticViewOptions viewing;
  viewing.noise_scale = noise_scale;
  const SyntheticView view = make_synthetic_view(truth, camera, viewing, rng);
  const auto table = find_table(view.depth, camera);
  EXPECT_TRUE(table);
  const LabelImage labels = segment(view.depth, camera, *table);
  KnownRecoveryOptions options;
  options.threads = threads;
  seen.found = recover_known(view.depth, camera, *table, labels, all_blocks(), options);
  seen.labels = label_recovered(view.depth, camera, *table, labels, seen.found);
  for (RecoveredObject& object : seen.found) {
    object.T_world_object = view.T_world_camera * table->T_world_camera.inverse() * object.T_world_object;
  }
  return seen;
}

std::string names_of(const SeenScene& seen) {
  std::string names;
  for (const RecoveredObject& found : seen.found) {
    names += found.name + " (label " + std::to_string(found.label) + ", " + std::to_string(found.pixels) +
             " pixels, score " + std::to_string(found.score) + ") ";
  }
  return names;
}

// The recovered object nearest to the true one has its shape and pose, up to the shape's symmetries.
void expect_found(const SeenScene& seen, std::size_t index, double metres, double radians) {
  const ObjectPtr& object = seen.truth.objects[index];
  const Pose& T_true = seen.truth.T_world_object[index];
  const RecoveredObject* nearest = nullptr;
  double distance = std::numeric_limits<double>::infinity();
  for (const RecoveredObject& found : seen.found) {
    const double apart = (found.T_world_object.translation() - T_true.translation()).norm();
    if (apart >= distance) continue;
    distance = apart;
    nearest = &found;
  }
  ASSERT_NE(nearest, nullptr) << object->name;
  EXPECT_EQ(nearest->name, object->name);
  EXPECT_TRUE(nearest->known);
  EXPECT_GT(nearest->score, 0.9) << object->name;
  EXPECT_LT(distance, metres) << object->name;
  double angle = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& symmetry : rotation_symmetries(object->mesh)) {
    angle = std::min(angle, rotation_angle(T_true.linear().transpose() * nearest->T_world_object.linear() * symmetry));
  }
  EXPECT_LT(angle, radians) << object->name;
}

Pose resting_at(const ObjectModel& model, std::size_t rest, double x, double y, double support, double yaw) {
  const RestingPose& pose = model.resting[rest].pose;
  return make_pose(so3_exp({0.0, 0.0, yaw}) * pose.R_world_object, {x, y, support + pose.height});
}

constexpr double kDegree = M_PI / 180.0;

class EveryBlock : public testing::TestWithParam<std::string> {};

// Exact readings, every way to rest, any yaw. The project's own bound: 1 mm and 1 degree.
TEST_P(EveryBlock, IsFoundInEveryRest) {
  const ObjectPtr object = make_block(GetParam());
  const ObjectModel model(object);
  Rng rng = make_rng(11);
  for (std::size_t rest = 0; rest < model.resting.size(); ++rest) {
    SCOPED_TRACE("rest " + std::to_string(rest));
    Scene scene;
    scene.objects = {object};
    scene.T_world_object = {resting_at(model, rest, 0.02, -0.01, 0.0, uniform(rng, 0.0, 2.0 * M_PI))};
    const SeenScene seen = see(scene, 0.0, 100 + rest);
    ASSERT_EQ(seen.found.size(), 1u) << names_of(seen);
    expect_found(seen, 0, 1e-3, 1.0 * kDegree);
  }
}

INSTANTIATE_TEST_SUITE_P(KnownRecovery, EveryBlock, testing::ValuesIn(block_names()),
                         [](const auto& shape) { return shape.param; });

// Readings with 1.9 mm of noise; two to three thousand of them fix a pose to some tenths of a millimetre.
TEST(KnownRecovery, TwoTouchingCubes) {
  const ObjectModel cube(make_block("cube"));
  Scene scene;
  scene.objects = {cube.object, cube.object};
  scene.T_world_object = {resting_at(cube, 0, -0.03, 0.0, 0.0, 0.2),
                          resting_at(cube, 0, -0.03 + 0.05 * std::cos(0.2) - 0.01 * std::sin(0.2),
                                     0.05 * std::sin(0.2) + 0.01 * std::cos(0.2), 0.0, 0.2)};
  const SeenScene seen = see(scene, 1.0, 7);
  ASSERT_EQ(seen.found.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) expect_found(seen, i, 1.5e-3, 1.5 * kDegree);
}

TEST(KnownRecovery, AStack) {
  const ObjectModel below(make_block("half_rectangle")), above(make_block("hat"));
  Scene scene;
  scene.objects = {below.object, above.object};
  const double top = 0.025;
  std::size_t flat = 0;  // the rest on the largest face
  for (std::size_t i = 0; i < below.resting.size(); ++i) {
    if (below.resting[i].pose.height < below.resting[flat].pose.height) flat = i;
  }
  scene.T_world_object = {resting_at(below, flat, 0.0, 0.0, 0.0, 0.5), resting_at(above, 0, 0.005, 0.0, top, 1.1)};
  const SeenScene seen = see(scene, 1.0, 8);
  ASSERT_EQ(seen.found.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) expect_found(seen, i, 1.5e-3, 1.5 * kDegree);
  // Nothing floats or overlaps by more than MuJoCo's contacts give: a tenth of a millimetre.
  const auto of = [&](const std::string& name) {
    return std::find_if(seen.found.begin(), seen.found.end(), [&](const auto& found) { return found.name == name; })
        ->T_world_object;
  };
  EXPECT_NEAR(clearance(below, of("half_rectangle"), above, of("hat")), 0.0, 2e-4);
}

TEST(KnownRecovery, TwoBlocksApartAndTheirLabels) {
  const ObjectModel wedge(make_block("tall_triangle")), pyramid(make_block("tetrahedron"));
  Scene scene;
  scene.objects = {wedge.object, pyramid.object};
  scene.T_world_object = {resting_at(wedge, 0, -0.1, 0.0, 0.0, 2.0), resting_at(pyramid, 0, 0.1, 0.02, 0.0, 0.3)};
  const SeenScene seen = see(scene, 1.0, 9);
  ASSERT_EQ(seen.found.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    expect_found(seen, i, 1.5e-3, 1.5 * kDegree);
    const auto count = std::count(seen.labels.pixels.begin(), seen.labels.pixels.end(), kLabelFirstObject + i);
    EXPECT_NEAR(static_cast<double>(count), seen.found[i].pixels, 0.1 * seen.found[i].pixels);
  }
}

TEST(KnownRecovery, ThreadsDoNotChangeTheResult) {
  const ObjectModel block(make_block("middle_triangle"));
  Scene scene;
  scene.objects = {block.object};
  scene.T_world_object = {resting_at(block, 0, 0.0, 0.0, 0.0, 0.7)};
  const SeenScene one = see(scene, 1.0, 3, 1), two = see(scene, 1.0, 3, 2);
  ASSERT_EQ(one.found.size(), two.found.size());
  for (std::size_t i = 0; i < one.found.size(); ++i) {
    EXPECT_EQ(one.found[i].T_world_object.matrix(), two.found[i].T_world_object.matrix());
  }
}

// A ball of 70 mm from 12 x 24 facets.
TriangleMesh ball_mesh(double radius) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i <= 12; ++i) {
    for (int j = 0; j < 24; ++j) {
      const double polar = M_PI * i / 12.0, around = 2.0 * M_PI * j / 24.0;
      points.emplace_back(radius * std::sin(polar) * std::cos(around), radius * std::sin(polar) * std::sin(around),
                          radius * std::cos(polar));
    }
  }
  return convex_hull(points);
}

TEST(KnownRecovery, AForeignObjectIsLeftOut) {
  Scene scene;
  scene.objects = {make_object("ball", ball_mesh(0.035)).object};
  scene.T_world_object = {make_pose(Eigen::Matrix3d::Identity(), {0.0, 0.0, 0.035})};
  const SeenScene seen = see(scene, 1.0, 4);
  EXPECT_TRUE(seen.found.empty()) << seen.found.front().name << " with score " << seen.found.front().score;
}

TEST(KnownRecovery, AnEmptyTableGivesNothing) { EXPECT_TRUE(see(Scene{}, 1.0, 5).found.empty()); }

TEST(KnownRecovery, RefusesWhatCannotBe) {
  const Camera camera = default_camera();
  const Table table;
  const DepthImage depth(camera.width, camera.height, 0.0f);
  const LabelImage labels(camera.width, camera.height, kLabelNothing);
  EXPECT_TRUE(recover_known(depth, camera, table, labels, all_blocks()).empty());
  EXPECT_THROW(recover_known(depth, camera, table, labels, {}), std::invalid_argument);
  EXPECT_THROW(recover_known(DepthImage(10, 10), camera, table, labels, all_blocks()), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
