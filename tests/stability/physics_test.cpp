#include "stability/physics.h"

#include <gtest/gtest.h>

#include "stability/metrics.h"
#include "stability/resting_poses.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

TEST(Simulator, EveryBlockRestsOnEachOfItsFaces) {
  for (const ObjectPtr& block : all_blocks()) {
    const Simulator simulator({block});
    for (const RestingPose& rest : resting_poses(block->mesh)) {
      const std::vector<Pose> start = {make_pose(rest.R_world_object, {0, 0, rest.height})};
      const SettleResult result = simulator.settle(start);
      EXPECT_EQ(result.status, SettleStatus::kSettled) << block->name;
      const Displacement moved = displacement({block}, start, result.T_world_object);
      EXPECT_LT(moved.translation_pct, 0.1) << block->name;  // soft contacts sink by hundredths of a per cent
      EXPECT_LT(moved.rotation_deg, 0.1) << block->name;
    }
  }
}

TEST(Simulator, ATiltedBoxFallsAndATowerOfTwoStands) {
  const ObjectPtr tall = make_block("rectangle");
  const Simulator one({tall});
  const Pose tilted = make_pose(so3_exp({0.6, 0, 0}), {0, 0, 0.065});
  const SettleResult fallen = one.settle({tilted});
  EXPECT_EQ(fallen.status, SettleStatus::kSettled);
  EXPECT_GT(displacement({tall}, {tilted}, fallen.T_world_object).rotation_deg, 25.0);

  const ObjectPtr cube = make_block("cube");
  const Simulator two({cube, tall});
  const std::vector<Pose> tower = {at(0, 0, 0.025), at(0.005, 0, 0.1)};
  const SettleResult standing = two.settle(tower);
  EXPECT_TRUE(is_stable(displacement({cube, tall}, tower, standing.T_world_object)));
  const std::vector<std::pair<int, int>> expected = {{-1, 0}, {0, 1}};
  EXPECT_EQ(standing.touching, expected);
}

TEST(Simulator, RecordingAMotionChangesNothing) {
  const Simulator simulator({make_block("cube"), make_block("hat")});
  const std::vector<Pose> start = {make_pose(so3_exp({0.4, 0.1, 0}), {0, 0, 0.05}), at(0.03, 0, 0.12)};  // falls and tumbles
  std::vector<std::vector<Pose>> frames;
  const SettleResult recorded = simulator.settle(start, 25.0, &frames), plain = simulator.settle(start);
  ASSERT_EQ(recorded.status, SettleStatus::kSettled);
  EXPECT_EQ(recorded.seconds, plain.seconds);
  // One at 0 s, one in every 0.04 s begun since, and the end.
  EXPECT_NEAR(static_cast<double>(frames.size()), recorded.seconds * 25.0 + 1.5, 1.0);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(frames.front()[i].isApprox(start[i], 1e-12));
    EXPECT_EQ(frames.back()[i].matrix(), plain.T_world_object[i].matrix());
  }
}

TEST(Simulator, ASettledSceneStays) {
  // Measured over 1,000 scenes (physics_study): 99th percentile 0.04 % or degrees.
  const std::vector<ObjectPtr> objects = {make_block("tall_triangle"), make_block("hat"), make_block("tetrahedron")};
  const Simulator simulator(objects);
  Rng rng = make_rng(11);
  for (int i = 0; i < 10; ++i) {
    std::vector<Pose> start;
    for (int k = 0; k < 3; ++k) {
      start.push_back(make_pose(random_rotation(rng), {uniform(rng, -0.03, 0.03), uniform(rng, -0.03, 0.03), 0.07 + 0.1 * k}));
    }
    const SettleResult first = simulator.settle(start);
    if (first.status != SettleStatus::kSettled) continue;
    const SettleResult second = simulator.settle(first.T_world_object);
    const Displacement moved = displacement(objects, first.T_world_object, second.T_world_object);
    EXPECT_LT(moved.translation_pct, 0.1);
    EXPECT_LT(moved.rotation_deg, 0.1);
  }
}

// The smallest value in [low, high] at which `falls` is true, to within `resolution`.
template <class Predicate>
double threshold(double low, double high, double resolution, Predicate falls) {
  while (high - low > resolution) {
    const double middle = (low + high) / 2.0;
    (falls(middle) ? high : low) = middle;
  }
  return (low + high) / 2.0;
}

bool moves(const Simulator& simulator, const std::vector<Pose>& start) {
  const SettleResult result = simulator.settle(start);
  return !is_stable(displacement(simulator.objects(), start, result.T_world_object));
}

TEST(Simulator, ABlockSlidesAboveTheFrictionAngleAndNotBelow) {
  // A ramp of slope tan(26.57 degrees) = 0.5, which is the friction needed; the cube moves by centimetres if it slides.
  const ObjectPtr wedge = make_object("wedge", prism_mesh({{-0.2, 0}, {0.2, 0}, {-0.2, 0.2}}, -0.1, 0.1)).object;
  const Pose lying = make_pose(so3_exp({M_PI / 2, 0, 0}), Vector3d::Zero());
  const double height = -(lying.linear() * Vector3d(0, bounding_box(wedge->mesh).min.y(), 0)).z();
  const Pose T_wedge = make_pose(lying.linear(), {0, 0, height});
  const double slope = std::atan(0.5);
  const ObjectPtr cube = make_block("cube", 0.6);
  // Near the top of the slope in the wedge's frame, lifted by half a cube along its normal.
  const Vector3d normal_wedge(std::sin(slope), std::cos(slope), 0);
  const Vector3d corner(bounding_box(wedge->mesh).min.x(), bounding_box(wedge->mesh).max.y(), 0);
  Pose T_cube = T_wedge * make_pose(Eigen::Matrix3d::Identity(), corner + Vector3d(0.1, -0.05, 0) + 0.015 * normal_wedge);
  T_cube.linear() = so3_exp({0, slope, 0});
  for (const auto& [friction, slides] : {std::pair{0.52, false}, {0.48, true}}) {
    PhysicsOptions options;
    options.friction = friction;
    EXPECT_EQ(moves(Simulator({wedge, cube}, options), {T_wedge, T_cube}), slides) << "friction " << friction;
  }
}

TEST(Simulator, ABlockOverAnEdgeTipsWhenItsCentreOfMassPassesIt) {
  // To 1 % of its size, over each side of a box of 50 mm: its edge is at 25 mm from its middle. Sideways by 10 mm and
  // turned by 0.2, since MuJoCo's own box-box collision holds up boxes by contacts beside them then.
  const ObjectPtr base = make_block("cube");
  for (const auto& [name, size] : {std::pair{"cube", 0.05}, {"rectangle", 0.1}}) {
    const ObjectPtr top = make_block(name);
    const double height = 0.05 + (bounding_box(top->mesh).max.z() - bounding_box(top->mesh).min.z()) / 2.0;
    const Simulator simulator({base, top}, {}, {true, false});
    for (const double side : {-1.0, 1.0}) {
      for (const double yaw : {0.0, 0.2}) {
        const double found = threshold(0.015, 0.035, 1e-4, [&](double x) {
          return moves(simulator, {at(0, 0, 0.025), make_pose(so3_exp({0, 0, yaw}), {side * x, 0.01, height})});
        });
        EXPECT_NEAR(found, 0.025, 0.01 * size) << name << ", side " << side << ", yaw " << yaw;
      }
    }
  }
}

TEST(Simulator, AnObjectOfConvexPartsHasItsOwnCentreOfMassAndSurface) {
  // An L of a long foot (100 x 50 x 20 mm) with a post (20 x 50 x 60 mm) on its end. Its centre of mass lies at
  // x = (100 * 50 + 60 * 10) / 160 of ... area 100 x 20 and 20 x 60: x = (2000 * 50 + 1200 * 10) / 3200 = 35 mm.
  const auto box_at = [](const Vector3d& low, const Vector3d& high) {
    return translated(box_mesh(high - low), (low + high) / 2.0);
  };
  const std::vector<TriangleMesh> parts = {box_at({0, 0, 0}, {0.1, 0.05, 0.02}), box_at({0, 0, 0.02}, {0.02, 0.05, 0.08})};
  TriangleMesh ell;  // the outline in x-z, swept along y
  const std::vector<Eigen::Vector2d> outline = {{0, 0}, {0.1, 0}, {0.1, 0.02}, {0.02, 0.02}, {0.02, 0.08}, {0, 0.08}};
  for (const double y : {0.0, 0.05}) {
    for (const auto& p : outline) ell.vertices.emplace_back(p.x(), y, p.y());
  }
  for (const auto& t : {Eigen::Vector3i(0, 1, 2), {0, 2, 3}, {0, 3, 4}, {0, 4, 5}}) {
    ell.triangles.push_back(t);                                       // seen from -y
    ell.triangles.emplace_back(6 + t[0], 6 + t[2], 6 + t[1]);
  }
  for (int i = 0; i < 6; ++i) {
    const int j = (i + 1) % 6;
    ell.triangles.emplace_back(j, i, 6 + i);
    ell.triangles.emplace_back(j, 6 + i, 6 + j);
  }
  const auto [object, origin] = make_object("ell", ell, parts);
  EXPECT_NEAR(origin.x(), 0.035, 1e-9);
  EXPECT_FALSE(object->convex);

  // On the edge of a fixed box: it tips when the centre of mass passes the edge.
  const ObjectPtr base = make_box("base", {0.2, 0.2, 0.1});
  const Simulator over_edge({base, object}, {}, {true, false});
  const double edge = threshold(0.08, 0.12, 1e-4, [&](double x) { return moves(over_edge, {at(0, 0, 0.05), at(x, 0, 0.1 + origin.z())}); });
  EXPECT_NEAR(edge, 0.1, 0.001);

  // A cube stands in the notch without touching; the hull would cover it.
  const ObjectPtr cube = make_block("cube", 0.5);
  const Simulator in_notch({object, cube});
  const std::vector<Pose> start = {at(0, 0, origin.z()), at(0.06 - origin.x(), 0.0, 0.02 + 0.0125)};
  const SettleResult result = in_notch.settle(start);
  EXPECT_LT(displacement(in_notch.objects(), start, result.T_world_object).translation_pct, 0.1);
  EXPECT_LT(result.initial_penetration, 2e-5);  // the corners are spheres of 0.01 mm
}

TEST(Simulator, APlankLeaningOnAWallSlidesBelowTheAngleOfTheLadder) {
  // Friction f at floor and wall alike: a ladder stands while tan(angle) >= (1 - f^2) / (2 f). The plank has a
  // thickness, and contacts are soft: three degrees are allowed.
  PhysicsOptions options;
  options.friction = 0.4;
  const double limit = std::atan((1 - 0.16) / 0.8);
  const double length = 0.2, thickness = 0.004;
  const ObjectPtr wall = make_box("wall", {0.05, 0.4, 0.4}), plank = make_box("plank", {length, 0.05, thickness});
  const Simulator simulator({wall, plank}, options, {true, false});
  const auto slides = [&](double angle) {
    // Its upper end on the face x = 0 of the wall, its lower end on the table.
    const double c = std::cos(angle), s = std::sin(angle);
    const Pose leaning = make_pose(so3_exp({0, angle, 0}), {-(length * c + thickness * s) / 2, 0, (length * s + thickness * c) / 2});
    const Pose towards_wall = make_pose(so3_exp({0, -angle, 0}), leaning.translation());
    return moves(simulator, {at(0.025, 0, 0.2), towards_wall});
  };
  EXPECT_NEAR(threshold(0.5, 1.2, 2e-3, [&](double angle) { return !slides(angle); }), limit, 3.0 * M_PI / 180.0);
}

TEST(Simulator, ALeaningPairStandsAndFallsWhenTheSupportGoes) {
  // Two planks against each other like cards, 60 degrees: each is a ladder against a wall without friction by symmetry,
  // which stands if the table's friction exceeds 1 / (2 tan 60) = 0.29.
  const double length = 0.1, thickness = 0.01, angle = M_PI / 3;
  const ObjectPtr plank = make_box("plank", {length, 0.05, thickness});
  const double c = std::cos(angle), s = std::sin(angle);
  const double x = (length * c + thickness * s) / 2, z = (length * s + thickness * c) / 2;
  const Pose left = make_pose(so3_exp({0, -angle, 0}), {-x, 0, z}), right = make_pose(so3_exp({0, angle, 0}), {x, 0, z});
  EXPECT_FALSE(moves(Simulator({plank, plank}), {left, right}));
  EXPECT_TRUE(moves(Simulator({plank}), {left}));
  PhysicsOptions slippery;
  slippery.friction = 0.2;
  EXPECT_TRUE(moves(Simulator({plank, plank}, slippery), {left, right}));
}

TEST(Simulator, FixedObjectsStayAndHoldOthers) {
  const ObjectPtr cube = make_block("cube");
  const Simulator simulator({cube, cube}, {}, {true, false});
  const std::vector<Pose> start = {at(0, 0, 0.2), at(0, 0, 0.25)};  // the lower one hangs in the air
  const SettleResult result = simulator.settle(start);
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  const Displacement moved = displacement({cube, cube}, start, result.T_world_object);
  EXPECT_LT(moved.translation_pct, 0.05);
  EXPECT_THROW(Simulator({cube}, {}, {true, false}), std::invalid_argument);
}

TEST(Simulator, RoundObjectsRollAndComeToRest) {
  const ObjectPtr ball = make_sphere("ball", 0.03), can = make_cylinder("can", 0.03, 0.1);
  const Simulator simulator({ball, can});
  const Pose on_its_side = make_pose(so3_exp({M_PI / 2, 0, 0}), {0.2, 0, 0.03});
  const std::vector<Pose> start = {at(0, 0, 0.03), on_its_side};
  const SettleResult result = simulator.settle(start);
  EXPECT_EQ(result.status, SettleStatus::kSettled);
  EXPECT_LT(displacement(simulator.objects(), start, result.T_world_object).translation_pct, 0.1);
  // A sideways force of a tenth of its weight for 0.2 s: the can rolls and stops.
  Loads loads;
  loads.forces = {Vector3d::Zero(), Vector3d(0.1 * 600 * can->volume * 9.81, 0, 0)};
  loads.forces_until = 0.2;
  const SettleResult rolled = simulator.run(start, loads, {20.0, true});
  EXPECT_EQ(rolled.status, SettleStatus::kSettled);
  EXPECT_GT(rolled.T_world_object[1].translation().x(), 0.21);
  EXPECT_GT(rolled.turned[1], 0.2);
}

TEST(Simulator, LoadsActForAsLongAsTheySay) {
  // Free fall under sideways gravity, and a force that balances the weight: nothing moves for a tenth of a second.
  const ObjectPtr cube = make_block("cube");
  const Simulator simulator({cube});
  Loads weightless;
  weightless.forces = {Vector3d(0, 0, 600 * cube->volume * 9.81)};
  const SettleResult floats = simulator.run({at(0, 0, 0.5)}, weightless, {0.1, false});
  EXPECT_NEAR(floats.T_world_object[0].translation().z(), 0.5, 1e-9);
  weightless.forces_until = 0.1;
  const SettleResult falls = simulator.run({at(0, 0, 0.5)}, weightless, {0.2, false});
  EXPECT_NEAR(falls.T_world_object[0].translation().z(), 0.5 - 0.5 * 9.81 * 0.01, 0.003);  // Euler's steps of 4 ms
  Loads sideways;
  sideways.gravity = {9.81, 0, 0};
  const SettleResult pulled = simulator.run({at(0, 0, 0.5)}, sideways, {0.2, false});
  EXPECT_NEAR(pulled.T_world_object[0].translation().x(), 0.5 * 9.81 * 0.04, 0.005);
  EXPECT_THROW(simulator.run({at(0, 0, 0.5)}, {{0, 0, 0}, {Vector3d::Zero(), Vector3d::Zero()}}, {}), std::invalid_argument);
}

TEST(Simulator, ReportsInitialPenetration) {
  const Simulator simulator({make_block("cube")});
  EXPECT_NEAR(simulator.settle({at(0, 0, 0.023)}).initial_penetration, 0.002, 1e-6);
  EXPECT_NEAR(simulator.settle({at(0, 0, 0.03)}).initial_penetration, 0.0, 1e-12);
}

TEST(Simulator, PenetrationOfTwoBoxesIsTheOverlapWhateverTouches) {
  const Simulator cubes({make_block("cube"), make_block("cube")});
  const double h = 0.025 * std::sqrt(2.0), overlap = 0.004;
  const auto turned = [](const Eigen::Vector3d& w, double z) { return make_pose(so3_exp(w), {0.003, 0.002, z}); };
  const Pose face = turned({0, 0, 0.3}, 0.2), edge_y = turned({0, M_PI / 4, 0}, 0.2);
  EXPECT_NEAR(cubes.settle({face, turned({0, 0, 0.1}, 0.25 - overlap)}).initial_penetration, overlap, 1e-6);
  EXPECT_NEAR(cubes.settle({face, turned({M_PI / 4, 0, 0}, 0.225 + h - overlap)}).initial_penetration, overlap, 1e-6);
  EXPECT_NEAR(cubes.settle({edge_y, turned({M_PI / 4, 0, 0}, 0.2 + 2 * h - overlap)}).initial_penetration, overlap, 1e-6);
}

TEST(Simulator, FacesOnFacesDoNotTremble) {
  // Wedges on blocks and on each other, and eight-sided prisms: with contacts from turned copies they rock by a tenth of
  // a degree for ever. Let go a hundredth of a millimetre above each other, they settle by that and stay.
  std::vector<Eigen::Vector2d> octagon;
  for (int i = 0; i < 8; ++i) octagon.emplace_back(0.03 * std::cos(M_PI / 4 * i), 0.03 * std::sin(M_PI / 4 * i));
  const ObjectPtr column = make_object("column", prism_mesh(octagon, -0.02, 0.02)).object;
  for (const auto& [below, above] : {std::pair{make_block("half_rectangle"), make_block("middle_triangle")},
                                     {make_block("cube"), make_block("tetrahedron")},
                                     {column, make_block("hat")},
                                     {column, column}}) {
    const BoundingBox box = bounding_box(below->mesh);
    const Simulator simulator({below, above});
    for (const RestingPose& rest : resting_poses(above->mesh)) {
      const double height = box.max.z() - box.min.z() + rest.height + 1e-5;
      const std::vector<Pose> start = {at(0, 0, -box.min.z()), make_pose(rest.R_world_object, {0.002, 0.001, height})};
      const SettleResult first = simulator.settle(start);
      EXPECT_EQ(first.status, SettleStatus::kSettled) << above->name << " on " << below->name;
      EXPECT_LT(first.seconds, 0.3) << above->name << " on " << below->name;
      const Displacement moved = displacement({below, above}, start, first.T_world_object);
      EXPECT_LT(moved.translation_pct, 0.1) << above->name << " on " << below->name;
      EXPECT_LT(moved.rotation_deg, 0.1) << above->name << " on " << below->name;
    }
  }
}

TEST(Simulator, ParallelEdgesThatJustTouchAreNoOverlap) {
  // MuJoCo's own box-box collision says half a metre for some of these angles.
  const ObjectPtr wall = make_box("wall", {0.05, 0.4, 0.4}), plank = make_box("plank", {0.2, 0.05, 0.004});
  const Simulator simulator({wall, plank}, {}, {true, false});
  for (int i = 0; i < 200; ++i) {
    const double angle = 0.4 + 0.005 * i, c = std::cos(angle), s = std::sin(angle);
    const Pose leaning = make_pose(so3_exp({0, -angle, 0}), {-(0.2 * c + 0.004 * s) / 2, 0, (0.2 * s + 0.004 * c) / 2});
    const SettleResult result = simulator.run({at(0.025, 0, 0.2), leaning}, {}, {0.02, false});
    EXPECT_NE(result.status, SettleStatus::kDiverged) << angle;
    EXPECT_LT(result.initial_penetration, 1e-9) << angle;
  }
}

TEST(Simulator, RefusesWrongCountsAndBadPoses) {
  const Simulator simulator({make_block("cube")});
  EXPECT_THROW(simulator.settle({}), std::invalid_argument);
  EXPECT_THROW(simulator.settle({at(0, 0, std::nan(""))}), std::invalid_argument);
}

TEST(SimulatorCache, GivesTheSameModelAgainAndForgetsTheOldest) {
  SimulatorCache cache({}, 2);
  const ObjectPtr cube = make_block("cube"), hat = make_block("hat");
  const Simulator* first = &cache.get({cube});
  EXPECT_EQ(first, &cache.get({cube}));
  cache.get({hat});
  EXPECT_EQ(first, &cache.get({cube}));  // used again, so {hat} is now the oldest
  cache.get({cube, hat});
  EXPECT_EQ(first, &cache.get({cube}));
}

}  // namespace
}  // namespace dofusion
