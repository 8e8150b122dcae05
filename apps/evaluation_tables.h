// The paper's tables I to V as rows, with the paper's own figures beside ours.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/evaluation.h"

namespace dofusion {

// What became of the instances, one outcome each, where a list is not empty.
struct TableOutcomes {
  std::vector<Outcome> seen;      // placed by a model that was trained on all shapes (ID)
  std::vector<Outcome> held_out;  // by models that have never seen the query's shape (OOD)
  std::vector<Outcome> random;    // by the random baseline
};

// The table `name` ("single", "stack-one", "stack-two", "unstructured"): for each of the paper's blocks and columns,
// and for all blocks together, the figure with its bootstrap 95 % interval, for each list of outcomes, and the paper's.
// General objects have the last row alone. Throws std::invalid_argument on an unknown name.
nlohmann::json table_rows(const std::string& name, const std::vector<Instance>& instances,
                          const TableOutcomes& outcomes, std::uint64_t seed);

// Table V, one row for each variant of the model ("full", "w/o SDF", "w/o pos") and column.
struct Variant {
  std::string name;
  TableOutcomes outcomes;
};
nlohmann::json ablation_rows(const std::vector<Instance>& instances, const std::vector<Variant>& variants,
                             std::uint64_t seed);

// The rows as an aligned text table for people.
std::string format_rows(const nlohmann::json& rows);

}  // namespace dofusion
