#include "stability/generation_plan.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

using testing::HasSubstr;

TEST(GenerationPlan, ThePapersHasItsCounts) {
  const GenerationPlan plan = finished_plan(paper_plan(), 1);
  std::int64_t unstructured[4] = {}, stacked[4] = {};
  for (const PlanPart& part : plan.parts) {
    EXPECT_EQ(part.options.shapes, ShapeFamily::kBlocks);
    (part.options.task == Task::kStack ? stacked : unstructured)[part.options.objects] += part.count;
  }
  EXPECT_EQ(unstructured[1], 100'000);
  EXPECT_EQ(unstructured[2], 200'000);
  EXPECT_EQ(unstructured[3], 300'000);
  EXPECT_GT(stacked[2], 0);
  EXPECT_GT(stacked[3], 0);
  EXPECT_EQ(scene_count(finished_plan(paper_plan(), 1, 1e-3)), 800);
  EXPECT_EQ(scene_count(finished_plan(paper_plan(), 1, 1e-9)), 5);  // one of each
}

TEST(GenerationPlan, NumbersRunThroughTheParts) {
  const GenerationPlan plan = finished_plan(paper_plan(), 1, 1e-4);
  std::int64_t number = 0;
  for (int part = 0; part < static_cast<int>(plan.parts.size()); ++part) {
    for (std::int64_t index = 0; index < plan.parts[static_cast<std::size_t>(part)].count; ++index, ++number) {
      EXPECT_EQ(number_of(plan, {part, index}), number);
      EXPECT_EQ(scene_at(plan, number).part, part);
      EXPECT_EQ(scene_at(plan, number).index, index);
    }
  }
  EXPECT_EQ(number, scene_count(plan));
  EXPECT_THROW(scene_at(plan, number), std::out_of_range);
}

TEST(GenerationPlan, PartsHaveTheirOwnSeedsAndTheFirstThePlans) {
  const GenerationPlan plan = finished_plan(paper_plan(), 7);
  EXPECT_EQ(plan.parts[0].options.seed, 7u);
  for (std::size_t a = 0; a < plan.parts.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) EXPECT_NE(plan.parts[a].options.seed, plan.parts[b].options.seed);
  }
  const auto settings = nlohmann::json::parse(to_json(plan));
  EXPECT_EQ(settings.at("seed"), 7);
  EXPECT_EQ(settings.at("parts").size(), 5u);
  EXPECT_EQ(settings["parts"][2].at("seed").get<std::uint64_t>(), plan.parts[2].options.seed);
  EXPECT_EQ(settings["parts"][2].at("count"), 300'000);
  EXPECT_EQ(settings["parts"][2].at("friction"), plan.parts[2].options.physics.friction);
  EXPECT_EQ(settings["split"].at("test"), plan.shares.test);
}

TEST(GenerationPlan, IsReadFromJson) {
  const GenerationPlan plan = plan_from_json(
      R"({"validation": 0.2, "parts": [{"task": "single", "count": 5},
          {"task": "stack", "objects": 3, "shapes": "general", "count": 7}]})",
      "recipe.json");
  ASSERT_EQ(plan.parts.size(), 2u);
  EXPECT_EQ(plan.parts[0].options.objects, 1);
  EXPECT_EQ(plan.parts[1].options.task, Task::kStack);
  EXPECT_EQ(plan.parts[1].options.objects, 3);
  EXPECT_EQ(plan.parts[1].options.shapes, ShapeFamily::kGeneral);
  EXPECT_EQ(plan.parts[1].count, 7);
  EXPECT_EQ(plan.shares.validation, 0.2);
  EXPECT_EQ(plan.shares.test, SplitShares{}.test);
}

TEST(GenerationPlan, WhatIsWrongInJsonIsNamed) {
  const std::string good = R"({"task": "single", "count": 5})";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"{", "recipe.json: "},
      {"[]", "object"},
      {"{}", "parts"},
      {R"({"parts": 3})", "'parts' should be a list"},
      {R"({"parts": [], "speed": 1})", "'speed' is unknown"},
      {R"({"parts": [], "test": "much"})", "recipe.json: "},
      {"{\"parts\": [" + good + R"(, {"task": "heap", "count": 5}]})", "part 1: unknown task 'heap'"},
      {R"({"parts": [{"task": "stack", "count": 5}]})", "part 0: key 'objects' not found"},
      {R"({"parts": [{"task": "stack", "objects": 9, "count": 5}]})", "part 0: 'objects' should be"},
      {R"({"parts": [{"task": "stack", "objects": 2, "count": -5}]})", "part 0: 'count' should be"},
      {R"({"parts": [{"task": "stack", "objects": 2, "count": 5, "colour": 1}]})", "part 0: 'colour' is unknown"},
      {R"({"parts": [{"task": 4, "count": 5}]})", "part 0: "},
      {R"({"parts": [7]})", "part 0: should be an object"}};
  for (const auto& [text, words] : cases) {
    try {
      plan_from_json(text, "recipe.json");
      ADD_FAILURE() << text;
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr("recipe.json: ")) << text;
      EXPECT_THAT(e.what(), HasSubstr(words)) << text;
    }
  }
}

TEST(GenerationPlan, ImpossibleOnesAreRefused) {
  EXPECT_THROW(finished_plan({}, 1), std::invalid_argument);
  EXPECT_THROW(finished_plan(paper_plan(), 1, 0.0), std::invalid_argument);
  EXPECT_THROW(finished_plan(paper_plan(), 1, 1e9), std::invalid_argument);
  GenerationPlan plan = paper_plan();
  plan.parts[0].options.objects = 2;  // single
  EXPECT_THROW(finished_plan(plan, 1), std::invalid_argument);
  plan = paper_plan();
  plan.shares.test = 1.5;
  EXPECT_THROW(finished_plan(plan, 1), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
