// What a dataset is to hold: a list of parts, each so many scenes of one kind, all from one seed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stability/generation.h"

namespace dofusion {

struct PlanPart {
  GenerationOptions options;  // its seed is the part's own, of part_seed()
  std::int64_t count = 0;     // scenes
};

struct GenerationPlan {
  std::uint64_t seed = 0;
  SplitShares shares;
  std::vector<PlanPart> parts;
};

// The seed of part `part` of a plan: the plan's for the first, so that a plan of one part is what its options alone
// give; for the others drawn from it, or equal numbers would begin with equal objects in every part.
std::uint64_t part_seed(std::uint64_t seed, int part);

// The paper's data: 100,000 scenes of one block, 200,000 of two and 300,000 of three, unstructured, and 100,000 stacks
// each of two and of three blocks. Without seeds: finished_plan() sets them.
GenerationPlan paper_plan();

// A plan from JSON text: {"parts": [{"task": "stack", "objects": 2, "shapes": "blocks", "count": 1000}, …],
// "validation": 0.01, "test": 0.01}; shapes and the shares may be left out, and "objects" of single scenes. Throws
// InputError naming `source` and the entry that is missing, unknown or of a wrong type or value.
GenerationPlan plan_from_json(const std::string& text, const std::string& source);

// The plan with `seed` and every count multiplied by `scale` > 0, rounded, at least 1. Throws std::invalid_argument if
// a part's kind of scene cannot be, or there is no part, or more than 100.
GenerationPlan finished_plan(GenerationPlan plan, std::uint64_t seed, double scale = 1.0);

std::int64_t scene_count(const GenerationPlan& plan);

// Scenes of a plan are numbered through, part by part.
struct PlannedScene {
  int part = 0;
  std::int64_t index = 0;  // within the part
};
PlannedScene scene_at(const GenerationPlan& plan, std::int64_t number);
std::int64_t number_of(const GenerationPlan& plan, const PlannedScene& scene);

// All of it as JSON text, for SceneDataset::settings.
std::string to_json(const GenerationPlan& plan);

}  // namespace dofusion
