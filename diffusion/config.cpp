#include "diffusion/config.h"

#include <stdexcept>

#include <nlohmann/json.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

using nlohmann::json;

// Calls visit(name, member) for every field but the preset.
template <typename Config, typename Visit>
void for_each_field(Config& c, Visit visit) {
  visit("points", c.points);
  visit("neighbours", c.neighbours);
  visit("widths", c.widths);
  visit("embedding", c.embedding);
  visit("hidden", c.hidden);
  visit("noise_frequencies", c.noise_frequencies);
  visit("sigma_min", c.sigma_min);
  visit("sigma_max", c.sigma_max);
  visit("schedule_steps", c.schedule_steps);
  visit("distance_limit", c.distance_limit);
  visit("contact_scales", c.contact_scales);
  visit("directions", c.directions);
  visit("query_share", c.query_share);
  visit("sharp_share", c.sharp_share);
  visit("point_head", c.point_head);
  visit("equivalent", c.equivalent);
  visit("perception_noise", c.perception_noise);
  visit("use_sdf", c.use_sdf);
  visit("use_pose", c.use_pose);
}

}  // namespace

std::string to_string(Preset preset) { return preset == Preset::kPaper ? "paper" : "default"; }

Preset preset_from_string(const std::string& name) {
  if (name == "default") return Preset::kDefault;
  if (name == "paper") return Preset::kPaper;
  throw std::invalid_argument("unknown preset '" + name + "': choose paper or default");
}

int ModelConfig::point_features() const {
  if (preset == Preset::kPaper) return 5;
  return 6 + 2 * static_cast<int>(contact_scales.size()) + (directions ? 6 : 0);
}

int ModelConfig::pose_features() const { return preset == Preset::kPaper ? 6 : 10; }

ModelConfig make_config(Preset preset) {
  ModelConfig config;
  config.preset = preset;
  if (preset == Preset::kPaper) {
    config.points = 384;
    config.neighbours = 20;
    config.contact_scales.clear();
    config.sigma_min = 0.01;
    config.sigma_max = 3.0;
  }
  return config;
}

std::string to_json(const ModelConfig& config) {
  json j;
  j["preset"] = to_string(config.preset);
  for_each_field(config, [&](const char* name, const auto& value) { j[name] = value; });
  return j.dump();
}

ModelConfig config_from_json(const std::string& text, const std::string& source, ModelConfig config) {
  json j;
  try {
    j = json::parse(text);
  } catch (const json::exception& error) {
    throw InputError(source + ": not valid JSON: " + error.what());
  }
  if (!j.is_object()) throw InputError(source + ": expected a JSON object of model settings");
  try {
    if (j.contains("preset")) {
      const Preset preset = preset_from_string(j.at("preset").get<std::string>());
      if (preset != config.preset) config = make_config(preset);
      j.erase("preset");
    }
    for_each_field(config, [&](const char* name, auto& value) {
      if (!j.contains(name)) return;
      try {
        value = j.at(name).get<std::decay_t<decltype(value)>>();
      } catch (const json::exception&) {
        throw InputError(source + ": '" + name + "' has the wrong type: " + j.at(name).dump());
      }
      j.erase(name);
    });
  } catch (const json::exception&) {
    throw InputError(source + ": 'preset' must be a string");
  } catch (const std::invalid_argument& error) {
    throw InputError(source + ": " + error.what());
  }
  if (!j.empty()) throw InputError(source + ": unknown setting '" + j.begin().key() + "'");
  check(config, source);
  return config;
}

void check(const ModelConfig& c, const std::string& source) {
  const auto require = [&](bool ok, const char* what) {
    if (!ok) throw InputError(source + ": " + what);
  };
  const bool paper = c.preset == Preset::kPaper;
  require(c.points >= 16 && c.points <= 4096 && c.points % 2 == 0, "points must be even and between 16 and 4096");
  require(c.neighbours >= 1 && c.neighbours <= 32 && c.neighbours <= c.points / 2,
          "neighbours must be between 1 and 32 and at most half the points");
  require(!c.widths.empty() && c.widths.size() <= 8, "widths must have 1 to 8 entries");
  for (const int width : c.widths)
    require(width >= 1 && width <= 2048 && (paper || width % 32 == 0), "widths must be multiples of 32, at most 2048");
  require(c.embedding >= 1 && c.embedding <= 4096 && (paper || c.embedding % 32 == 0),
          "embedding must be a multiple of 32, at most 4096");
  require(c.hidden >= 1 && c.hidden <= 4096 && (paper || c.hidden % 32 == 0),
          "hidden must be a multiple of 32, at most 4096");
  require(c.query_share >= 0 && c.query_share < 1, "query_share must be at least 0 and below 1");
  require(c.sharp_share >= 0 && c.sharp_share <= 1, "sharp_share must be between 0 and 1");
  require(c.point_head >= 0 && c.point_head <= 1024 && c.point_head % 32 == 0,
          "point_head must be a multiple of 32, at most 1024");
  require(!paper || (!c.directions && c.query_share == 0 && c.sharp_share == 0 && c.point_head == 0 && !c.equivalent),
          "directions, query_share, sharp_share, point_head and equivalent belong to the default preset");
  require(c.perception_noise >= 0 && c.perception_noise <= 1, "perception_noise must be between 0 and 1");
  require(c.noise_frequencies >= 0 && c.noise_frequencies <= 32, "noise_frequencies must be between 0 and 32");
  require(c.sigma_min > 0 && c.sigma_max > c.sigma_min && c.sigma_max < 100,
          "0 < sigma_min < sigma_max < 100 must hold");
  require(c.schedule_steps >= 2 && c.schedule_steps <= 10000, "schedule_steps must be between 2 and 10000");
  require(c.distance_limit > 0 && c.distance_limit < 1000, "distance_limit must be positive");
  require(c.contact_scales.size() <= 8, "contact_scales must have at most 8 entries");
  for (const double scale : c.contact_scales) require(scale > 0 && scale < 100, "contact_scales must be positive");
}

}  // namespace dofusion
