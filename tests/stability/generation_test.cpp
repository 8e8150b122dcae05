#include "stability/generation.h"

#include <gtest/gtest.h>

#include <set>

#include "stability/metrics.h"

namespace dofusion {
namespace {

SceneDataset shapes_of(const SceneGenerator& generator) {
  SceneDataset dataset;
  dataset.shapes = generator.shapes();
  return dataset;
}

TEST(SceneGenerator, MakesScenesThatStandOfEveryKind) {
  SimulatorCache simulators;
  for (const ShapeFamily family : {ShapeFamily::kBlocks, ShapeFamily::kGeneral}) {
    for (const auto& [task, objects] : {std::pair{Task::kSingle, 1}, {Task::kUnstructured, 3}, {Task::kStack, 2}}) {
      GenerationOptions options;
      options.task = task;
      options.objects = objects;
      options.shapes = family;
      SceneGenerator generator(options);
      const SceneDataset shapes = shapes_of(generator);
      for (int i = 0; i < 5; ++i) {
        const SceneRecord record = generator.generate(i);
        ASSERT_EQ(static_cast<int>(record.objects.size()), objects);
        const Scene scene = to_scene(shapes, record);
        const SettleResult again = simulators.get(scene.objects).settle(scene.T_world_object);
        const Displacement moved = displacement(scene.objects, scene.T_world_object, again.T_world_object);
        EXPECT_LT(moved.translation_pct, 1.0) << to_string(task);
        EXPECT_LT(moved.rotation_deg, 1.0) << to_string(task);
        EXPECT_LT(again.initial_penetration, 5e-4) << to_string(task);
      }
    }
  }
}

TEST(SceneGenerator, ASceneDependsOnSeedAndIndexAlone) {
  GenerationOptions options;
  options.seed = 42;
  SceneGenerator in_order(options), alone(options);
  SceneRecord third;
  for (int i = 0; i < 4; ++i) third = in_order.generate(i);
  const SceneRecord again = alone.generate(3);
  ASSERT_EQ(third.objects.size(), again.objects.size());
  for (std::size_t k = 0; k < again.objects.size(); ++k) {
    EXPECT_EQ(third.objects[k].shape, again.objects[k].shape);
    EXPECT_EQ(to_array(third.objects[k].T_world_object), to_array(again.objects[k].T_world_object));
  }
}

TEST(SceneGenerator, InStacksEachObjectStandsOnTheOneBefore) {
  GenerationOptions options;
  options.task = Task::kStack;
  options.objects = 3;
  SceneGenerator generator(options);
  for (int i = 0; i < 3; ++i) {
    const SceneRecord record = generator.generate(i);
    EXPECT_EQ(record.objects[0].touches, 0b0101u);  // the table and object 1
    EXPECT_EQ(record.objects[1].touches, 0b1010u);  // objects 0 and 2
    EXPECT_EQ(record.objects[2].touches, 0b0100u);  // object 1
  }
}

TEST(SceneGenerator, GeneralScenesDrawFromAllFamiliesWithSizesAtMostThreeApart) {
  GenerationOptions options;
  options.objects = 3;
  options.shapes = ShapeFamily::kGeneral;
  SceneGenerator generator(options);
  const SceneDataset shapes = shapes_of(generator);
  std::set<std::string> names;
  for (int i = 0; i < 25; ++i) {
    const Scene scene = to_scene(shapes, generator.generate(i));
    double smallest = 1e9, largest = 0;
    for (const ObjectPtr& object : scene.objects) {
      names.insert(object->name);
      smallest = std::min(smallest, object->diameter);
      largest = std::max(largest, object->diameter);
      if (object->box_edges) {
        EXPECT_LE(object->box_edges->maxCoeff() / object->box_edges->minCoeff(), 8.0 + 1e-9);
      }
      EXPECT_EQ(object->convex, object->parts.empty()) << object->name;
    }
    EXPECT_LE(largest / smallest, 3.0 + 1e-6);  // a tessellated cylinder's diameter is its round one's to a millionth
  }
  EXPECT_GE(names.size(), 8u);  // of 9 families and 7 blocks, in 75 objects
}

TEST(SceneGenerator, RefusesImpossibleCounts) {
  GenerationOptions options;
  options.objects = 7;
  EXPECT_THROW(SceneGenerator{options}, std::invalid_argument);
  options.objects = 1;
  EXPECT_THROW(SceneGenerator{options}, std::invalid_argument);  // unstructured with one
}

TEST(RandomPlacement, HangsJustAboveAndMostlyFalls) {
  const ObjectPtr cube = make_block("cube");
  const Scene context{{cube}, {make_pose(Eigen::Matrix3d::Identity(), {0.3, 0.2, 0.025})}};
  const ObjectPtr query = make_block("rectangle");
  const Simulator simulator({cube, query});
  Rng rng = make_rng(12);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  int stable = 0;
  const int n = 100;
  for (int i = 0; i < n; ++i) {
    const Pose pose = random_placement(context, *query, Task::kUnstructured, rng);
    mean += pose.translation().head<2>() / n;
    const std::vector<Pose> start = {context.T_world_object[0], pose};
    const SettleResult result = simulator.settle(start);
    EXPECT_EQ(result.initial_penetration, 0.0);
    stable += is_stable(displacement({cube, query}, start, result.T_world_object)) ? 1 : 0;
  }
  EXPECT_LT((mean - Eigen::Vector2d(0.3, 0.2)).norm(), 4 * query->diameter * std::sqrt(2.0 / n));
  EXPECT_LT(stable, n / 4);
}

}  // namespace
}  // namespace dofusion
