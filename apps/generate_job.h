// Makes a dataset of a plan: on all threads of all ranks, by way of a journal, so that a kill costs nothing but the
// scenes in hand.
#pragma once

#include <functional>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/ranks.h"
#include "stability/generation_plan.h"

namespace dofusion {

// The journal of the dataset `out`.
std::string journal_path(const std::string& out);

struct GenerateResult {
  nlohmann::ordered_json summary;  // for --json: scenes, drops and splits of every part and of all, seconds
  std::string line;                // for the user
};

// On the first rank: goes on with what `out`'s journal has, writes `out` when all scenes are there, and deletes the
// journal. The bytes of `out` depend on the plan alone. Throws InputError if a file cannot be written or belongs to
// another plan, Interrupted if the user ends the program; `out` is then as it was, and the journal stays.
GenerateResult generate_dataset(Ranks& ranks, const GenerationPlan& plan, const std::string& out, int threads);

// On every other rank: helps the first, which must have the same plan.
void help_to_generate(Ranks& ranks, const std::function<GenerationPlan()>& make_plan, int threads);

}  // namespace dofusion
