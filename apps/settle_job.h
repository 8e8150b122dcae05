// Lets a scene go and says what became of it: for people, and machine-readable.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "stability/outcome.h"
#include "stability/scene.h"

namespace dofusion {

struct SettleJob {
  std::string mjcf, keyframe;  // an MJCF file and where it starts from, as MjcfScene has it …
  std::string data;            // … or, if `mjcf` is empty, a dataset
  std::int64_t scene = 0;      // of the dataset
  std::string query;           // name or index of a body that moves; empty: none
  double time_limit = 4.0;     // simulated seconds
  std::string out;             // a folder for the settled scene as MJCF; empty: none
};

struct SettledBody {
  std::string name;
  double diameter = 0.0;                 // metres
  Outcome outcome;                       // its own figures
  Pose T_world_body = Pose::Identity();  // at the end
  std::vector<std::string> touches;      // names of others; "surroundings": the table and all else that does not move
};

// How firmly the query stands once the scene has settled, in the toolkit's own physics.
struct QueryReport {
  std::string name;
  double largest_push = 0.0;  // in weights, stability/robustness.h
  bool comes_off = false;     // upside down
};

struct SettleReport {
  std::string source;
  Outcome outcome;                   // of the whole scene
  double seconds = 0.0;              // simulated
  std::vector<SettledBody> bodies;   // that move
  std::optional<QueryReport> query;  // none if the simulation diverged
};

// Throws InputError if a file cannot be read or written, the dataset has no such scene, there is no such query, or more
// than one; or if `query` or `out` needs objects on a table and the MJCF file is no such scene.
SettleReport settle_scene(const SettleJob& job);

std::string to_text(const SettleReport& report);
nlohmann::ordered_json to_json(const SettleReport& report);

}  // namespace dofusion
