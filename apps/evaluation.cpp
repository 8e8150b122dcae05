#include "apps/evaluation.h"

#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "apps/program.h"
#include "stability/generation.h"
#include "stability/parallel_for.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

constexpr std::int64_t kStreamsPerInstance = 1'000'000;  // scene numbers an instance may try to find its shape

const std::vector<std::pair<std::string, std::string>>& paper_names() {
  static const std::vector<std::pair<std::string, std::string>> names = {
      {"tall_triangle", "Tall Triangle"}, {"middle_triangle", "Middle Triangle"}, {"half_rectangle", "Half Rectangle"},
      {"rectangle", "Rectangle"},         {"cube", "Cube"},                       {"tetrahedron", "Tetrahedron"},
      {"hat", "Hat"}};
  return names;
}

// What the paper prints: the model's figure in distribution and the random baseline's.
struct PaperFigures {
  double model, random;
};
using PaperColumn = std::map<std::string, PaperFigures>;

const PaperColumn kStackOne = {{"tall_triangle", {81.6, 67.6}}, {"middle_triangle", {87.2, 36.2}},
                               {"half_rectangle", {87.0, 46.8}}, {"rectangle", {94.6, 51.0}},
                               {"cube", {95.6, 71.6}},           {"tetrahedron", {80.0, 23.4}},
                               {"hat", {75.6, 69.8}}};
const PaperColumn kStackTwo = {{"tall_triangle", {46.6, 18.4}}, {"middle_triangle", {53.2, 16.8}},
                               {"half_rectangle", {65.8, 15.4}}, {"rectangle", {80.2, 13.0}},
                               {"cube", {90.8, 14.4}},           {"tetrahedron", {65.2, 22.4}},
                               {"hat", {46.6, 28.2}}};
const PaperColumn kUnstructuredTranslation = {{"tall_triangle", {25.2, 76.4}}, {"middle_triangle", {6.8, 125.0}},
                                              {"half_rectangle", {26.2, 87.5}}, {"rectangle", {12.6, 80.5}},
                                              {"cube", {2.3, 103.1}},           {"tetrahedron", {5.5, 125.8}},
                                              {"hat", {13.4, 115.5}},           {"all", {13.1, std::nan("")}}};
const PaperColumn kUnstructuredRotation = {{"tall_triangle", {26.8, 54.6}}, {"middle_triangle", {5.7, 50.3}},
                                           {"half_rectangle", {22.2, 53.5}}, {"rectangle", {10.0, 48.9}},
                                           {"cube", {1.8, 43.9}},            {"tetrahedron", {3.5, 45.7}},
                                           {"hat", {12.1, 48.1}},            {"all", {11.7, std::nan("")}}};
const PaperColumn kSingleTranslation = {{"all", {1.2, 90.7}}};
const PaperColumn kSingleRotation = {{"all", {1.2, 37.2}}};

struct Column {
  std::string name;
  PaperColumn paper;
  bool mean;  // of a rate; otherwise the median
  std::function<double(const Outcome&)> value;
};

double translation(const Outcome& o) { return o.displacement.translation_pct; }
double rotation(const Outcome& o) { return o.displacement.rotation_deg; }
double stable_pct(const Outcome& o) { return o.stable ? 100.0 : 0.0; }
double quiet_pct(const Outcome& o) { return o.quiet ? 100.0 : 0.0; }
double tilted_pct(const Outcome& o) { return o.tilted ? 100.0 : 0.0; }
double stacked_pct(const Outcome& o) { return o.stacked ? 100.0 : 0.0; }
double penetration_mm(const Outcome& o) { return 1000.0 * o.initial_penetration; }

std::vector<Column> columns_of(const std::string& table) {
  const Column stable{"Stable at 10 % and 10 deg (%)", {}, true, stable_pct};
  // What neighbouring work reports.
  const Column quiet{"Accumulated rotation below 10 deg (%)", {}, true, quiet_pct};
  const Column tilted{"Tilted by more than 20 deg (%)", {}, true, tilted_pct};
  const Column penetration{"Penetration at the start (mm)", {}, false, penetration_mm};
  if (table == "single") {
    return {{"Translational Displacement (%)", kSingleTranslation, false, translation},
            {"Rotational Displacement (deg)", kSingleRotation, false, rotation},
            stable,
            quiet,
            tilted,
            penetration};
  }
  if (table == "stack-one") return {{"Success rate (%)", kStackOne, true, stacked_pct}, stable, quiet, tilted, penetration};
  if (table == "stack-two") return {{"Success rate (%)", kStackTwo, true, stacked_pct}, stable, quiet, tilted, penetration};
  if (table == "unstructured") {
    return {{"Trans. Disp. (%)", kUnstructuredTranslation, false, translation},
            {"Rot. Disp. (deg)", kUnstructuredRotation, false, rotation},
            stable,
            quiet,
            tilted,
            penetration};
  }
  throw std::invalid_argument("unknown table '" + table + "'; choose single, stack-one, stack-two or unstructured");
}

nlohmann::json number_or_null(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

struct Estimate {
  double value;
  Interval interval;
};

Estimate estimate(const std::vector<double>& values, bool mean, Rng& rng) {
  if (!mean) return {median(values), bootstrap_median(values, rng)};
  double sum = 0.0;
  for (const double v : values) sum += v;
  return {sum / static_cast<double>(values.size()), bootstrap_mean(values, rng)};
}

}  // namespace

std::vector<Instance> make_instances(const InstanceOptions& options) {
  if (options.shape) block_mesh(*options.shape);  // throws on an unknown name
  GenerationOptions generation;
  generation.task = options.task;
  generation.objects = options.context + 1;
  generation.seed = options.seed;
  std::vector<std::unique_ptr<SceneGenerator>> generators;
  for (int t = 0; t < options.threads; ++t) generators.push_back(std::make_unique<SceneGenerator>(generation));
  // Shapes of one generator, so that equal blocks are one object for all threads.
  SceneDataset shapes;
  shapes.shapes = generators.front()->shapes();

  std::vector<Instance> instances(static_cast<std::size_t>(options.count));
  parallel_for(options.count, options.threads, [&](std::int64_t i, int thread) {
    const std::string wanted = options.shape.value_or(block_names()[static_cast<std::size_t>(i) % 7]);
    for (std::int64_t k = 0;; ++k) {
      if (interrupted()) throw Interrupted("interrupted");
      const std::int64_t index = i * kStreamsPerInstance + k;
      const SceneRecord record = generators[static_cast<std::size_t>(thread)]->generate(index);
      Rng rng = make_rng(options.seed ^ 0x9e3779b97f4a7c15ull, static_cast<std::uint64_t>(index));
      const int last = static_cast<int>(record.objects.size()) - 1;
      const int query = options.task == Task::kStack ? last : uniform_int(rng, 0, last);
      if (shapes.shapes[static_cast<std::size_t>(record.objects[static_cast<std::size_t>(query)].shape)]->name != wanted) continue;
      Scene scene = to_scene(shapes, record);
      Instance& instance = instances[static_cast<std::size_t>(i)];
      instance.query = scene.objects[static_cast<std::size_t>(query)];
      instance.task = options.task;
      scene.objects.erase(scene.objects.begin() + query);
      scene.T_world_object.erase(scene.T_world_object.begin() + query);
      instance.context = std::move(scene);
      return;
    }
  });
  return instances;
}

std::vector<Outcome> settle_placements(const std::vector<Instance>& instances, const std::vector<Pose>& T_world_query,
                                       int threads, const PhysicsOptions& physics) {
  if (T_world_query.size() != instances.size()) throw std::invalid_argument("one pose per instance is needed");
  std::vector<std::unique_ptr<SimulatorCache>> simulators;
  for (int t = 0; t < threads; ++t) simulators.push_back(std::make_unique<SimulatorCache>(physics));
  std::vector<Outcome> outcomes(instances.size());
  parallel_for(static_cast<std::int64_t>(instances.size()), threads, [&](std::int64_t i, int thread) {
    const Instance& instance = instances[static_cast<std::size_t>(i)];
    std::vector<ObjectPtr> objects = instance.context.objects;
    std::vector<Pose> start = instance.context.T_world_object;
    objects.push_back(instance.query);
    start.push_back(T_world_query[static_cast<std::size_t>(i)]);
    const SettleResult settled = simulators[static_cast<std::size_t>(thread)]->get(objects).settle(start);
    outcomes[static_cast<std::size_t>(i)] = judge(objects, start, settled, static_cast<int>(objects.size()) - 1);
  });
  return outcomes;
}

std::vector<Pose> sample_placements(const std::vector<Instance>& instances, const PlacementModel& model,
                                    std::uint64_t seed, const SamplerOptions& options) {
  std::vector<PlacementProblem> problems;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    PlacementProblem problem;
    problem.context = instances[i].context;
    problem.query = instances[i].query;
    problem.seed = make_rng(seed, i)();
    problem.centre = default_centre(problem.context);
    problems.push_back(std::move(problem));
  }
  return model.sample(problems, options);
}

std::vector<Pose> random_placements(const std::vector<Instance>& instances, std::uint64_t seed) {
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    Rng rng = make_rng(seed, i);
    poses.push_back(random_placement(instances[i].context, *instances[i].query, instances[i].task, rng));
  }
  return poses;
}

nlohmann::json table_rows(const std::string& name, const std::vector<Instance>& instances,
                          const std::vector<Outcome>& model, const std::vector<Outcome>& random, std::uint64_t seed) {
  auto blocks = paper_names();
  blocks.emplace_back("all", "All blocks");
  const std::size_t context = instances.empty() ? 0 : instances.front().context.objects.size();
  nlohmann::json rows = nlohmann::json::array();
  Rng rng = make_rng(seed, 0xb007);
  for (const Column& column : columns_of(name)) {
    for (const auto& [shape, block] : blocks) {
      std::vector<double> ours, baseline;
      for (std::size_t i = 0; i < instances.size(); ++i) {
        if (shape != "all" && instances[i].query->name != shape) continue;
        ours.push_back(column.value(model[i]));
        baseline.push_back(column.value(random[i]));
      }
      if (ours.empty()) continue;
      const Estimate a = estimate(ours, column.mean, rng), b = estimate(baseline, column.mean, rng);
      // The paper prints unstructured figures for two context blocks alone.
      const auto paper = column.paper.find(shape);
      const bool printed = paper != column.paper.end() && (name != "unstructured" || context == 2);
      rows.push_back({{"block", block},
                      {"column", column.name},
                      {"instances", ours.size()},
                      {"seed", seed},
                      {"dofusion", number_or_null(a.value)},
                      {"dofusion_95", {number_or_null(a.interval.low), number_or_null(a.interval.high)}},
                      {"random", number_or_null(b.value)},
                      {"random_95", {number_or_null(b.interval.low), number_or_null(b.interval.high)}},
                      {"paper", printed ? number_or_null(paper->second.model) : nlohmann::json()},
                      {"paper_random", printed ? number_or_null(paper->second.random) : nlohmann::json()}});
    }
  }
  return rows;
}

std::string format_rows(const nlohmann::json& rows) {
  const auto text = [](const nlohmann::json& value) {
    if (value.is_null()) return std::string("-");
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, value.get<double>() < 10.0 ? "%.2f" : "%.1f", value.get<double>());
    return std::string(buffer);
  };
  std::string out, column;
  char line[256];
  for (const auto& row : rows) {
    if (row["column"] != column) {
      column = row["column"];
      std::snprintf(line, sizeof line, "%s%s\n  %-16s %6s  %8s %19s  %8s %8s %13s\n", out.empty() ? "" : "\n",
                    column.c_str(), "block", "n", "dofusion", "95 %", "random", "paper", "paper random");
      out += line;
    }
    const std::string interval = text(row["dofusion_95"][0]) + " .. " + text(row["dofusion_95"][1]);
    std::snprintf(line, sizeof line, "  %-16s %6ld  %8s %19s  %8s %8s %13s\n", row["block"].get<std::string>().c_str(),
                  row["instances"].get<long>(), text(row["dofusion"]).c_str(), interval.c_str(),
                  text(row["random"]).c_str(), text(row["paper"]).c_str(), text(row["paper_random"]).c_str());
    out += line;
  }
  return out;
}

}  // namespace dofusion
