#include "apps/evaluation.h"
#include "apps/evaluation_tables.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace dofusion {
namespace {

Pose at(double x, double y, double z) { return make_pose(Eigen::Matrix3d::Identity(), {x, y, z}); }

Instance onto_one_cube(Task task) { return {{{make_block("cube")}, {at(0, 0, 0.025)}}, make_block("cube"), task}; }

Outcome settle_one(const Instance& instance, const Pose& pose) { return settle_placements({instance}, {pose}, 1).front(); }

TEST(MakeInstances, QueriesHaveTheWantedShape) {
  InstanceOptions options;
  options.count = 3;
  options.shape = "hat";
  options.context = 1;
  for (const Instance& instance : make_instances(options)) {
    EXPECT_EQ(instance.query->name, "hat");
    EXPECT_EQ(instance.context.objects.size(), 1u);
    EXPECT_EQ(instance.context.T_world_object.size(), 1u);
  }
  options.shape = "banana";
  EXPECT_THROW(make_instances(options), std::invalid_argument);
}

TEST(MakeInstances, ShapesComeInTurnAndThreadsChangeNothing) {
  InstanceOptions options;
  options.task = Task::kUnstructured;
  options.context = 1;
  options.count = 8;
  options.seed = 3;
  const std::vector<Instance> one = make_instances(options);
  options.threads = 3;
  const std::vector<Instance> three = make_instances(options);
  ASSERT_EQ(one.size(), 8u);
  EXPECT_EQ(one[0].query->name, one[7].query->name);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].query->name, three[i].query->name);
    ASSERT_EQ(three[i].context.objects.size(), 1u);
    EXPECT_EQ(one[i].context.objects[0]->name, three[i].context.objects[0]->name);
    EXPECT_EQ(one[i].context.T_world_object[0].matrix(), three[i].context.T_world_object[0].matrix());
  }
}

TEST(MakeInstances, SingleHasNoContextAndAStackLosesItsTop) {
  InstanceOptions options;
  options.count = 2;
  options.task = Task::kSingle;
  options.context = 0;
  for (const Instance& instance : make_instances(options)) EXPECT_TRUE(instance.context.objects.empty());
  options.task = Task::kStack;
  options.context = 1;
  for (const Instance& instance : make_instances(options)) {
    ASSERT_EQ(instance.context.objects.size(), 1u);
    // What is left of a stack of two stands on the table alone.
    EXPECT_TRUE(settle_placements({{{}, instance.context.objects[0], Task::kSingle}}, {instance.context.T_world_object[0]}, 1)
                    .front()
                    .stable);
  }
}

TEST(SettlePlacements, PerfectIsStableAndThrownIsNot) {
  const Instance instance = onto_one_cube(Task::kUnstructured);
  const Outcome perfect = settle_one(instance, at(0.1, 0, 0.025));
  EXPECT_EQ(perfect.status, SettleStatus::kSettled);
  EXPECT_TRUE(perfect.stable);
  EXPECT_LT(perfect.displacement.translation_pct, 0.5);
  EXPECT_LT(perfect.displacement.rotation_deg, 0.5);
  const Outcome thrown = settle_one(instance, at(0.1, 0, 0.325));
  EXPECT_FALSE(thrown.stable);
  EXPECT_GT(thrown.displacement.translation_pct, 100.0);
  EXPECT_THROW(settle_placements({instance}, {}, 1), std::invalid_argument);
}

TEST(SettlePlacements, AStackIsOneOnTheOtherAndNothingElse) {
  const Instance instance = onto_one_cube(Task::kStack);
  EXPECT_TRUE(settle_one(instance, at(0, 0, 0.075)).stacked);
  EXPECT_FALSE(settle_one(instance, at(0.1, 0, 0.025)).stacked);  // beside: stable, no stack
  EXPECT_FALSE(settle_one(instance, at(0.04, 0, 0.075)).stacked);  // falls off
  // A bridge that rests on its cube and on the table is none either.
  const Instance leaning{instance.context, make_block("rectangle"), Task::kStack};
  EXPECT_FALSE(settle_one(leaning, make_pose(so3_exp({0, M_PI / 4, 0}), {0.06, 0, 0.06})).stacked);
}

TEST(SettlePlacements, ThreadsChangeNothing) {
  const std::vector<Instance> instances(4, onto_one_cube(Task::kUnstructured));
  const std::vector<Pose> poses = {at(0.1, 0, 0.03), at(0.02, 0, 0.08), at(0, 0, 0.2), at(0.04, 0.01, 0.09)};
  const auto one = settle_placements(instances, poses, 1), four = settle_placements(instances, poses, 4);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(one[i].displacement.translation_pct, four[i].displacement.translation_pct);
    EXPECT_EQ(one[i].displacement.rotation_deg, four[i].displacement.rotation_deg);
  }
}

TEST(Instances, OfDatasetsAreSpreadOverTheirScenesAndOfStacksTakeTheTop) {
  SceneDataset dataset;
  dataset.shapes = {make_block("cube"), make_block("hat")};
  for (int i = 0; i < 10; ++i) {
    SceneRecord record;
    record.task = Task::kStack;
    record.objects.resize(2);
    record.objects[1].shape = 1;
    record.objects[0].T_world_object = at(0.1 * i, 0, 0.025);
    record.objects[1].T_world_object = at(0.1 * i, 0, 0.065);
    dataset.scenes.push_back(record);
  }
  const std::vector<Instance> instances = instances_of({dataset}, 4, 1);
  ASSERT_EQ(instances.size(), 4u);
  const double x[] = {0.0, 0.2, 0.5, 0.7};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(instances[i].query->name, "hat");
    ASSERT_EQ(instances[i].context.objects.size(), 1u);
    EXPECT_EQ(instances[i].context.objects[0]->name, "cube");
    EXPECT_NEAR(instances[i].T_world_query.translation().x(), x[i], 1e-12);
    EXPECT_TRUE(instances[i].context_stands);
  }
  EXPECT_EQ(instances_of({dataset}, 100, 1).size(), 10u);

  // Without its foot the upper one hangs in the air: a context that needs its query.
  for (SceneRecord& record : dataset.scenes) {
    record.task = Task::kUnstructured;
    record.objects[0].T_world_object.translation().z() = 0.4;
    record.objects[1].T_world_object.translation().z() = 0.44;
  }
  for (const Instance& instance : instances_of({dataset}, 10, 1)) EXPECT_FALSE(instance.context_stands);
}

TEST(ContactModes, AreWhatTheQueryTouches) {
  std::vector<Outcome> outcomes(4);
  for (Outcome& outcome : outcomes) outcome.stable = true;
  EXPECT_EQ(contact_mode_name(contact_mode(outcomes[0])), "held by none");
  outcomes[0].on_table = true;
  EXPECT_EQ(contact_mode_name(contact_mode(outcomes[0])), "table alone");
  outcomes[1].touches = 1;
  EXPECT_EQ(contact_mode_name(contact_mode(outcomes[1])), "one object");
  outcomes[2].on_table = true;
  outcomes[2].touches = 5;
  EXPECT_EQ(contact_mode_name(contact_mode(outcomes[2])), "table and several objects");
  outcomes[3] = outcomes[2];

  EXPECT_NEAR(contact_entropy(outcomes), 1.5, 1e-12);  // shares of 1/4, 1/4, 1/2
  outcomes[0].stable = outcomes[1].stable = false;     // what fell counts for nothing
  EXPECT_EQ(contact_entropy(outcomes), 0.0);
  EXPECT_EQ(contact_entropy({}), 0.0);
}

TEST(SupportShare, CountsContextsThatFallWithoutTheQuery) {
  std::vector<Instance> instances(4, onto_one_cube(Task::kUnstructured));
  std::vector<Outcome> outcomes(4);
  outcomes[0].stable = true;
  EXPECT_TRUE(std::isnan(support_share(instances, outcomes)));
  instances[1].context_stands = instances[2].context_stands = instances[3].context_stands = false;
  outcomes[3].stable = true;
  EXPECT_NEAR(support_share(instances, outcomes), 1.0 / 3.0, 1e-12);
}

TEST(RandomPlacements, SeedRepeats) {
  const std::vector<Instance> instances(3, onto_one_cube(Task::kUnstructured));
  const auto a = random_placements(instances, 1), b = random_placements(instances, 1), c = random_placements(instances, 2);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(a[i].matrix(), b[i].matrix());
    EXPECT_NE(a[i].matrix(), c[i].matrix());
  }
}

TEST(TableRows, MedianIntervalBaselineAndThePapersFigures) {
  Instance instance = onto_one_cube(Task::kUnstructured);  // with a second one, as in the paper's table
  instance.context.objects.push_back(make_block("cube"));
  instance.context.T_world_object.push_back(at(0.2, 0, 0.025));
  const std::vector<Instance> instances(3, instance);
  std::vector<Outcome> ours(3), random(3);
  const double values[] = {3.0, 1.0, 2.0};
  for (std::size_t i = 0; i < 3; ++i) {
    ours[i].displacement = {values[i], 5.0};
    ours[i].stable = i != 0;
    random[i].displacement = {80.0, std::numeric_limits<double>::infinity()};
  }
  const nlohmann::json rows = table_rows("unstructured", instances, {ours, {}, random}, 9);
  ASSERT_EQ(rows.size(), 14u);  // the cube and all blocks, in seven columns
  const nlohmann::json& cube = rows[0];
  EXPECT_EQ(cube["block"], "Cube");
  EXPECT_EQ(cube["column"], "Trans. Disp. (%)");
  EXPECT_EQ(cube["instances"], 3);
  EXPECT_EQ(cube["seed"], 9);
  EXPECT_EQ(cube["dofusion"], 2.0);
  EXPECT_GE(cube["dofusion_95"][0].get<double>(), 1.0);
  EXPECT_LE(cube["dofusion_95"][1].get<double>(), 3.0);
  EXPECT_EQ(cube["random"], 80.0);
  EXPECT_TRUE(cube["dofusion_ood"].is_null());
  EXPECT_EQ(cube["paper"], 2.3);
  EXPECT_EQ(cube["paper_ood"], 2.7);
  EXPECT_EQ(cube["paper_random"], 103.1);
  EXPECT_EQ(rows[1]["block"], "All");
  EXPECT_EQ(rows[1]["paper"], 13.1);
  EXPECT_TRUE(rows[2]["random"].is_null());  // infinite: the simulations diverged
  EXPECT_NEAR(rows[4]["dofusion"].get<double>(), 200.0 / 3.0, 1e-9);
  EXPECT_THAT(format_rows(rows), testing::AllOf(testing::HasSubstr("Cube"), testing::HasSubstr("103.1")));
  EXPECT_THROW(table_rows("nonsense", instances, {ours, {}, random}, 9), std::invalid_argument);
}

TEST(AblationRows, AreOneForEachVariantAndColumnWithThePapersFigures) {
  const std::vector<Instance> instances(3, onto_one_cube(Task::kUnstructured));
  std::vector<Variant> variants(2);
  variants[0].name = "full";
  variants[1].name = "w/o SDF";
  for (Variant& variant : variants) {
    variant.outcomes.seen.resize(3);
    for (Outcome& outcome : variant.outcomes.seen) outcome.displacement = {variant.name == "full" ? 1.0 : 7.0, 2.0};
  }
  variants[0].outcomes.seen[0].stable = true;
  const nlohmann::json rows = ablation_rows(instances, variants, 4);
  ASSERT_EQ(rows.size(), 6u);
  EXPECT_EQ(rows[0]["block"], "full");
  EXPECT_EQ(rows[0]["dofusion"], 1.0);
  EXPECT_EQ(rows[1]["block"], "w/o SDF");
  EXPECT_EQ(rows[1]["dofusion"], 7.0);
  EXPECT_GT(rows[1]["paper"].get<double>(), rows[0]["paper"].get<double>());
  EXPECT_NEAR(rows[4]["dofusion"].get<double>(), 100.0 / 3.0, 1e-9);
  EXPECT_EQ(rows[5]["dofusion"], 0.0);
}

}  // namespace
}  // namespace dofusion
