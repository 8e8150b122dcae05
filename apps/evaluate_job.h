// The work of dofusion-evaluate: scenes, samples, physics, tables.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/evaluation.h"

namespace dofusion {

struct EvaluateSettings {
  std::string table = "unstructured";  // single, stack-one, stack-two, unstructured or ablation
  // Model files. What each is for stands in it: one that has seen every shape answers for all instances, one with a
  // held-out shape for those whose query that is, and those without SDF or pose are variants for the ablation.
  std::vector<std::string> models;
  std::string shape;              // only queries of this block; empty: all
  std::string shapes = "blocks";  // or general
  int context = 2;                // objects besides the query in unstructured scenes
  int instances = 500;
  int best_of = 1;  // samples a scene of which physics may choose one, for a figure beside the table
  std::uint64_t seed = 20000;
  SamplerOptions sampler;
};

// {"format": "dofusion-evaluation", "version": 2, table, settings, "models", "rows", "placements"}. Throws InputError
// if a model cannot be read, two are for the same, or none has never seen a shape that the table needs.
nlohmann::json evaluate(const EvaluateSettings& settings);

// For people.
std::string format_evaluation(const nlohmann::json& result);

}  // namespace dofusion
