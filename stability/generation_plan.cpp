#include "stability/generation_plan.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

using nlohmann::json;

constexpr std::size_t kMostParts = 100;  // their settings fit into an HDF5 attribute, 64 KB
constexpr std::int64_t kMostScenes = 100'000'000;
constexpr std::uint64_t kPartSeeds = 0x9a27;  // keeps the parts' seeds apart from other draws

PlanPart part_of(Task task, int objects, std::int64_t count) {
  PlanPart part;
  part.options.task = task;
  part.options.objects = objects;
  part.count = count;
  return part;
}

void refuse_unknown(const json& object, const std::set<std::string>& known) {
  if (!object.is_object()) throw std::invalid_argument("should be an object {…}");
  for (const auto& [key, value] : object.items()) {
    if (known.count(key) == 0) throw std::invalid_argument("'" + key + "' is unknown");
  }
}

std::int64_t whole_number(const json& object, const char* key, std::int64_t least, std::int64_t most) {
  const json& value = object.at(key);
  if (!value.is_number_integer() || value < least || value > most) {
    throw std::invalid_argument("'" + std::string(key) + "' should be a whole number of " + std::to_string(least) +
                                " to " + std::to_string(most));
  }
  return value.get<std::int64_t>();
}

PlanPart part_from_json(const json& object) {
  refuse_unknown(object, {"task", "objects", "shapes", "count"});
  const Task task = task_from_string(object.at("task").get<std::string>());
  const bool implied = task == Task::kSingle && !object.contains("objects");
  const auto objects = implied ? 1 : whole_number(object, "objects", 1, 6);
  PlanPart part = part_of(task, static_cast<int>(objects), whole_number(object, "count", 1, kMostScenes));
  part.options.shapes = shape_family_from_string(object.value("shapes", "blocks"));
  return part;
}

}  // namespace

std::uint64_t part_seed(std::uint64_t seed, int part) {
  return part == 0 ? seed : make_rng(seed ^ kPartSeeds, static_cast<std::uint64_t>(part))();
}

GenerationPlan paper_plan() {
  GenerationPlan plan;
  plan.parts = {part_of(Task::kSingle, 1, 100'000), part_of(Task::kUnstructured, 2, 200'000),
                part_of(Task::kUnstructured, 3, 300'000), part_of(Task::kStack, 2, 100'000),
                part_of(Task::kStack, 3, 100'000)};
  return plan;
}

GenerationPlan plan_from_json(const std::string& text, const std::string& source) {
  std::string place;
  try {
    const json object = json::parse(text);
    refuse_unknown(object, {"parts", "validation", "test"});
    GenerationPlan plan;
    plan.shares.validation = object.value("validation", plan.shares.validation);
    plan.shares.test = object.value("test", plan.shares.test);
    if (!object.at("parts").is_array()) throw std::invalid_argument("'parts' should be a list [...]");
    for (const json& part : object.at("parts")) {
      place = "part " + std::to_string(plan.parts.size()) + ": ";
      plan.parts.push_back(part_from_json(part));
    }
    return plan;
  } catch (const json::exception& e) {
    const std::string what = e.what();
    throw InputError(source + ": " + place + what.substr(what.find("] ") + 2));
  } catch (const std::invalid_argument& e) {
    throw InputError(source + ": " + place + e.what());
  }
}

GenerationPlan finished_plan(GenerationPlan plan, std::uint64_t seed, double scale) {
  if (!(scale > 0.0)) throw std::invalid_argument("a plan is scaled by a positive factor");
  if (plan.parts.empty() || plan.parts.size() > kMostParts) {
    throw std::invalid_argument("a plan has 1 to " + std::to_string(kMostParts) + " parts, not " +
                                std::to_string(plan.parts.size()));
  }
  plan.seed = seed;
  for (std::size_t k = 0; k < plan.parts.size(); ++k) {
    PlanPart& part = plan.parts[k];
    const double count = std::max(1.0, std::round(static_cast<double>(part.count) * scale));
    if (count > static_cast<double>(kMostScenes)) throw std::invalid_argument("a part has at most 100 million scenes");
    part.count = static_cast<std::int64_t>(count);
    part.options.seed = part_seed(seed, static_cast<int>(k));
    const SceneGenerator possible(part.options);  // throws if not
  }
  split_of(seed, 0, 0, plan.shares);  // throws if the shares cannot be
  return plan;
}

std::int64_t scene_count(const GenerationPlan& plan) {
  std::int64_t count = 0;
  for (const PlanPart& part : plan.parts) count += part.count;
  return count;
}

PlannedScene scene_at(const GenerationPlan& plan, std::int64_t number) {
  PlannedScene scene{0, number};
  while (scene.index >= plan.parts.at(static_cast<std::size_t>(scene.part)).count) {
    scene.index -= plan.parts[static_cast<std::size_t>(scene.part)].count;
    ++scene.part;
  }
  return scene;
}

std::int64_t number_of(const GenerationPlan& plan, const PlannedScene& scene) {
  std::int64_t number = scene.index;
  for (int part = 0; part < scene.part; ++part) number += plan.parts.at(static_cast<std::size_t>(part)).count;
  return number;
}

std::string to_json(const GenerationPlan& plan) {
  json parts = json::array();
  for (const PlanPart& part : plan.parts) {
    json object = json::parse(to_json(part.options));
    object["count"] = part.count;
    parts.push_back(std::move(object));
  }
  const json shares{{"validation", plan.shares.validation}, {"test", plan.shares.test}};
  return json{{"seed", plan.seed}, {"split", shares}, {"parts", parts}}.dump();
}

}  // namespace dofusion
