#include "apps/evaluate_job.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "apps/evaluation_tables.h"
#include "diffusion/weights.h"
#include "stability/files.h"

namespace dofusion {
namespace {

using Json = nlohmann::json;

struct Contestant {
  std::string path, variant, held_out;  // held_out: the shape that it has never seen, if any
  PlacementModel model;
  double samples_millions = 0.0;
};

std::string variant_of(const ModelConfig& config) {
  if (!config.use_sdf) return "w/o SDF";
  return config.use_pose ? "full" : "w/o pos";
}

std::vector<Contestant> read_contestants(const std::vector<std::string>& paths) {
  std::vector<Contestant> contestants;
  std::map<std::pair<std::string, std::string>, std::string> taken;
  for (const std::string& path : paths) {
    const ModelFile file = read_model(path);
    const Json record = file.training.empty() ? Json::object() : Json::parse(file.training, nullptr, false);
    Contestant contestant{path, variant_of(file.config), "", PlacementModel(file.config, file.parameters)};
    if (record.is_object()) {
      contestant.held_out = record.value("holdout_shape", "");
      contestant.samples_millions = 1e-6 * record.value("samples", 0.0);
    }
    const auto [entry, is_new] = taken.emplace(std::make_pair(contestant.variant, contestant.held_out), path);
    if (!is_new)
      throw InputError(path + ": is for the same as " + entry->second + " (" + contestant.variant +
                       (contestant.held_out.empty() ? "" : ", never saw " + contestant.held_out) +
                       "); give one of them");
    contestants.push_back(std::move(contestant));
  }
  return contestants;
}

InstanceOptions instance_options(const EvaluateSettings& settings) {
  InstanceOptions options;
  options.seed = settings.seed;
  options.count = settings.instances;
  options.threads = settings.sampler.threads;
  options.shapes = shape_family_from_string(settings.shapes);
  if (!settings.shape.empty()) options.shape = settings.shape;
  const std::string& table = settings.table;
  if (table == "single") options.task = Task::kSingle;
  if (table == "stack-one" || table == "stack-two") options.task = Task::kStack;
  options.context = table == "single" ? 0 : table == "stack-one" ? 1 : table == "stack-two" ? 2 : settings.context;
  return options;
}

struct Timer {
  double seconds = 0.0;
  std::int64_t poses = 0;
};

std::vector<Outcome> place(const std::vector<Instance>& instances, const PlacementModel& model,
                           const EvaluateSettings& settings, std::uint64_t seed, Timer& timer) {
  const auto start = std::chrono::steady_clock::now();
  const std::vector<Pose> poses = sample_placements(instances, model, seed, settings.sampler);
  timer.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  timer.poses += static_cast<std::int64_t>(poses.size());
  return settle_placements(instances, poses, settings.sampler.threads);
}

// By the models of one variant.
TableOutcomes place_all(const std::vector<Instance>& instances, const std::vector<const Contestant*>& contestants,
                        const EvaluateSettings& settings, Timer& timer) {
  TableOutcomes outcomes;
  std::set<std::string> covered;
  std::vector<Outcome> held_out(instances.size());
  for (const Contestant* contestant : contestants) {
    if (contestant->held_out.empty()) {
      outcomes.seen = place(instances, contestant->model, settings, settings.seed, timer);
      continue;
    }
    covered.insert(contestant->held_out);
    std::vector<Instance> mine;
    std::vector<std::size_t> at;
    for (std::size_t i = 0; i < instances.size(); ++i) {
      if (instances[i].query->name != contestant->held_out) continue;
      mine.push_back(instances[i]);
      at.push_back(i);
    }
    const std::vector<Outcome> results = place(mine, contestant->model, settings, settings.seed, timer);
    for (std::size_t k = 0; k < at.size(); ++k) held_out[at[k]] = results[k];
  }
  if (covered.empty()) return outcomes;
  for (const Instance& instance : instances) {
    if (covered.count(instance.query->name) == 0)
      throw InputError("--model: no model has never seen '" + instance.query->name +
                       "'; add one, or choose a block with --shape");
  }
  outcomes.held_out = std::move(held_out);
  return outcomes;
}

// How varied the placements are, and what choosing among several with physics would give.
Json describe_placements(const std::vector<Instance>& instances, const std::vector<Outcome>& outcomes) {
  Json modes = Json::object();
  std::vector<int> counts(kContactModes);
  int stable = 0;
  for (const Outcome& outcome : outcomes) {
    if (!outcome.stable) continue;
    ++stable;
    ++counts[static_cast<std::size_t>(contact_mode(outcome))];
  }
  for (int mode = 0; mode < kContactModes; ++mode) {
    if (counts[static_cast<std::size_t>(mode)] > 0)
      modes[contact_mode_name(mode)] =
          static_cast<double>(counts[static_cast<std::size_t>(mode)]) / std::max(1, stable);
  }
  const double support = support_share(instances, outcomes);
  return {{"contact_modes", modes},
          {"contact_entropy_bits", contact_entropy(outcomes)},
          {"support_given_when_needed", std::isfinite(support) ? Json(support) : Json()}};
}

double best_of(const std::vector<Instance>& instances, const PlacementModel& model, const std::vector<Outcome>& first,
               const EvaluateSettings& settings, Timer& timer) {
  std::vector<char> found(instances.size());
  for (std::size_t i = 0; i < found.size(); ++i) found[i] = first[i].stable ? 1 : 0;
  for (int k = 1; k < settings.best_of; ++k) {
    const std::uint64_t seed = settings.seed + 1'000'003ull * static_cast<std::uint64_t>(k);
    const std::vector<Outcome> more = place(instances, model, settings, seed, timer);
    for (std::size_t i = 0; i < found.size(); ++i) found[i] = found[i] || more[i].stable ? 1 : 0;
  }
  return static_cast<double>(std::count(found.begin(), found.end(), 1)) / static_cast<double>(found.size());
}

}  // namespace

Json evaluate(const EvaluateSettings& settings) {
  const std::vector<Contestant> contestants = read_contestants(settings.models);
  const std::vector<Instance> instances = make_instances(instance_options(settings));
  std::map<std::string, std::vector<const Contestant*>> variants;
  for (const Contestant& contestant : contestants) variants[contestant.variant].push_back(&contestant);

  Timer timer;
  Json result = {{"format", "dofusion-evaluation"},
                 {"version", 2},
                 {"table", settings.table},
                 {"shapes", settings.shapes},
                 {"context", instances.front().context.objects.size()},
                 {"instances", settings.instances},
                 {"seed", settings.seed},
                 {"steps", settings.sampler.steps}};
  result["models"] = Json::array();
  for (const Contestant& c : contestants)
    result["models"].push_back({{"file", std::filesystem::path(c.path).filename().string()},
                                {"variant", c.variant},
                                {"held_out", c.held_out},
                                {"training_samples_millions", c.samples_millions}});
  if (settings.table == "ablation") {
    std::vector<Variant> placed;
    for (const char* name : {"full", "w/o SDF", "w/o pos"})
      if (variants.count(name) > 0) placed.push_back({name, place_all(instances, variants[name], settings, timer)});
    result["rows"] = ablation_rows(instances, placed, settings.seed);
  } else {
    if (variants.size() > 1) throw InputError("--model: models without SDF or pose are for --table ablation");
    TableOutcomes outcomes = place_all(instances, variants.begin()->second, settings, timer);
    outcomes.random =
        settle_placements(instances, random_placements(instances, settings.seed), settings.sampler.threads);
    result["rows"] = table_rows(settings.table, instances, outcomes, settings.seed);
    const std::vector<Outcome>& ours = outcomes.seen.empty() ? outcomes.held_out : outcomes.seen;
    result["placements"] = describe_placements(instances, ours);
    result["held_out_data"] = describe_placements(
        instances, settle_placements(instances, held_out_placements(instances), settings.sampler.threads));
    if (settings.best_of > 1 && !outcomes.seen.empty()) {
      for (const Contestant& c : contestants)
        if (c.held_out.empty()) {
          result["best_of"] = settings.best_of;
          result["best_of_stable_pct"] = 100.0 * best_of(instances, c.model, ours, settings, timer);
        }
    }
  }
  result["milliseconds_a_pose"] = 1000.0 * timer.seconds / static_cast<double>(std::max<std::int64_t>(1, timer.poses));
  result["threads"] = settings.sampler.threads;
  return result;
}

std::string format_evaluation(const Json& result) {
  std::string out = format_rows(result["rows"]);
  char line[200];
  if (result.contains("placements")) {
    out += "\nWhat the query touches, of stable placements (of held-out data)\n";
    const Json &ours = result["placements"], &data = result["held_out_data"];
    for (int mode = 0; mode < kContactModes; ++mode) {
      const std::string name = contact_mode_name(mode);
      const double a = ours["contact_modes"].value(name, 0.0), b = data["contact_modes"].value(name, 0.0);
      if (a == 0.0 && b == 0.0) continue;
      std::snprintf(line, sizeof line, "  %-26s %5.1f %%  (%5.1f %%)\n", name.c_str(), 100.0 * a, 100.0 * b);
      out += line;
    }
    std::snprintf(line, sizeof line, "  %-26s %5.2f bits (%.2f)\n", "entropy",
                  ours["contact_entropy_bits"].get<double>(), data["contact_entropy_bits"].get<double>());
    out += line;
    if (!ours["support_given_when_needed"].is_null()) {
      std::snprintf(line, sizeof line, "Contexts that fall without the query: it holds %.1f %% of them\n",
                    100.0 * ours["support_given_when_needed"].get<double>());
      out += line;
    }
  }
  if (result.contains("best_of")) {
    std::snprintf(line, sizeof line, "At least one of %d samples is stable: %.1f %%\n", result["best_of"].get<int>(),
                  result["best_of_stable_pct"].get<double>());
    out += line;
  }
  std::snprintf(line, sizeof line, "%.1f ms a pose on %d threads\n", result["milliseconds_a_pose"].get<double>(),
                result["threads"].get<int>());
  return out + line;
}

}  // namespace dofusion
