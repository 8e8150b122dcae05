#include "apps/evaluation_tables.h"

#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <stdexcept>

#include <nlohmann/json.hpp>

namespace dofusion {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Blocks in the paper's order, and its names for them.
const std::vector<std::pair<std::string, std::string>>& paper_names() {
  static const std::vector<std::pair<std::string, std::string>> names = {{"tall_triangle", "Tall Triangle"},
                                                                         {"middle_triangle", "Middle Triangle"},
                                                                         {"half_rectangle", "Half Rectangle"},
                                                                         {"rectangle", "Rectangle"},
                                                                         {"cube", "Cube"},
                                                                         {"tetrahedron", "Tetrahedron"},
                                                                         {"hat", "Hat"}};
  return names;
}

// What the paper prints: the model's figures in and out of distribution, and the random baseline's (of the
// unstructured table, that of its first half).
struct PaperFigures {
  double seen, held_out, random;
};
using PaperColumn = std::map<std::string, PaperFigures>;

const PaperColumn kStackOne = {{"tall_triangle", {81.6, 75.6, 67.6}},
                               {"middle_triangle", {87.2, 83.8, 36.2}},
                               {"half_rectangle", {87.0, 75.6, 46.8}},
                               {"rectangle", {94.6, 87.6, 51.0}},
                               {"cube", {95.6, 89.6, 71.6}},
                               {"tetrahedron", {80.0, 52.2, 23.4}},
                               {"hat", {75.6, 68.0, 69.8}}};
const PaperColumn kStackTwo = {{"tall_triangle", {46.6, 31.8, 18.4}},
                               {"middle_triangle", {53.2, 43.8, 16.8}},
                               {"half_rectangle", {65.8, 54.2, 15.4}},
                               {"rectangle", {80.2, 65.0, 13.0}},
                               {"cube", {90.8, 79.6, 14.4}},
                               {"tetrahedron", {65.2, 26.6, 22.4}},
                               {"hat", {46.6, 18.8, 28.2}}};
// "all" is table V's "Full".
const PaperColumn kUnstructuredTranslation = {{"tall_triangle", {25.2, 17.9, 76.4}},
                                              {"middle_triangle", {6.8, 9.5, 125.0}},
                                              {"half_rectangle", {26.2, 32.8, 87.5}},
                                              {"rectangle", {12.6, 40.0, 80.5}},
                                              {"cube", {2.3, 2.7, 103.1}},
                                              {"tetrahedron", {5.5, 8.5, 125.8}},
                                              {"hat", {13.4, 18.5, 115.5}},
                                              {"all", {13.1, 18.6, kNone}}};
const PaperColumn kUnstructuredRotation = {{"tall_triangle", {26.8, 21.0, 54.6}},
                                           {"middle_triangle", {5.7, 7.5, 50.3}},
                                           {"half_rectangle", {22.2, 25.7, 53.5}},
                                           {"rectangle", {10.0, 22.0, 48.9}},
                                           {"cube", {1.8, 2.3, 43.9}},
                                           {"tetrahedron", {3.5, 5.9, 45.7}},
                                           {"hat", {12.1, 15.2, 48.1}},
                                           {"all", {11.7, 14.3, kNone}}};
const PaperColumn kSingleTranslation = {{"all", {1.2, 2.4, 90.7}}};
const PaperColumn kSingleRotation = {{"all", {1.2, 1.4, 37.2}}};
// Table V, by variant.
const PaperColumn kAblationTranslation = {
    {"full", {13.1, 18.6, kNone}}, {"w/o SDF", {18.5, 27.7, kNone}}, {"w/o pos", {70.0, 82.7, kNone}}};
const PaperColumn kAblationRotation = {
    {"full", {11.7, 14.3, kNone}}, {"w/o SDF", {15.6, 25.5, kNone}}, {"w/o pos", {74.0, 80.5, kNone}}};

struct Column {
  std::string name;
  PaperColumn paper;
  bool mean;  // of a rate; otherwise the median
  std::function<double(const Outcome&)> value;
};

double translation(const Outcome& o) { return o.displacement.translation_pct; }
double rotation(const Outcome& o) { return o.displacement.rotation_deg; }
double stable_pct(const Outcome& o) { return o.stable ? 100.0 : 0.0; }
double stacked_pct(const Outcome& o) { return o.stacked ? 100.0 : 0.0; }

// What the paper has not: stricter, and what neighbouring work reports.
std::vector<Column> further_columns() {
  const auto still_pct = [](const Outcome& o) {
    const bool still = o.stable && o.displacement.translation_pct <= 5.0 && o.displacement.rotation_deg <= 5.0;
    return still ? 100.0 : 0.0;
  };
  return {
      {"Stable at 10 % and 10 deg (%)", {}, true, stable_pct},
      {"Stable at 5 % and 5 deg (%)", {}, true, still_pct},
      {"Accumulated rotation below 10 deg (%)", {}, true, [](const Outcome& o) { return o.quiet ? 100.0 : 0.0; }},
      {"Tilted by more than 20 deg (%)", {}, true, [](const Outcome& o) { return o.tilted ? 100.0 : 0.0; }},
      {"Penetration at the start (mm)", {}, false, [](const Outcome& o) { return 1000.0 * o.initial_penetration; }}};
}

std::vector<Column> columns_of(const std::string& table) {
  std::vector<Column> columns;
  if (table == "single") {
    columns = {{"Translational Displacement (%)", kSingleTranslation, false, translation},
               {"Rotational Displacement (deg)", kSingleRotation, false, rotation}};
  } else if (table == "stack-one") {
    columns = {{"Success rate (%)", kStackOne, true, stacked_pct}};
  } else if (table == "stack-two") {
    columns = {{"Success rate (%)", kStackTwo, true, stacked_pct}};
  } else if (table == "unstructured") {
    columns = {{"Trans. Disp. (%)", kUnstructuredTranslation, false, translation},
               {"Rot. Disp. (deg)", kUnstructuredRotation, false, rotation}};
  } else {
    throw std::invalid_argument("unknown table '" + table + "'; choose single, stack-one, stack-two or unstructured");
  }
  for (Column& column : further_columns()) columns.push_back(std::move(column));
  return columns;
}

nlohmann::json number_or_null(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

// Adds the figure of some outcomes and its interval under `key`; null if there are none.
void add_estimate(const std::string& key, const Column& column, const std::vector<Outcome>& outcomes,
                  const std::vector<std::size_t>& chosen, Rng& rng, nlohmann::json& row) {
  row[key] = nullptr;
  row[key + "_95"] = {nullptr, nullptr};
  if (outcomes.empty()) return;
  std::vector<double> values;
  for (const std::size_t i : chosen) values.push_back(column.value(outcomes[i]));
  double value = median(values);
  if (column.mean) {
    value = 0.0;
    for (const double v : values) value += v / static_cast<double>(values.size());
  }
  const Interval interval = column.mean ? bootstrap_mean(values, rng) : bootstrap_median(values, rng);
  row[key] = number_or_null(value);
  row[key + "_95"] = {number_or_null(interval.low), number_or_null(interval.high)};
}

nlohmann::json make_row(const std::string& block, const Column& column, const PaperFigures& paper,
                        const TableOutcomes& outcomes, const std::vector<std::size_t>& chosen, std::uint64_t seed,
                        Rng& rng) {
  nlohmann::json row = {{"block", block}, {"column", column.name}, {"instances", chosen.size()}, {"seed", seed}};
  add_estimate("dofusion", column, outcomes.seen, chosen, rng, row);
  add_estimate("dofusion_ood", column, outcomes.held_out, chosen, rng, row);
  add_estimate("random", column, outcomes.random, chosen, rng, row);
  row["paper"] = number_or_null(paper.seen);
  row["paper_ood"] = number_or_null(paper.held_out);
  row["paper_random"] = number_or_null(paper.random);
  return row;
}

PaperFigures figures_of(const PaperColumn& column, const std::string& key) {
  const auto found = column.find(key);
  return found == column.end() ? PaperFigures{kNone, kNone, kNone} : found->second;
}

}  // namespace

nlohmann::json table_rows(const std::string& name, const std::vector<Instance>& instances,
                          const TableOutcomes& outcomes, std::uint64_t seed) {
  auto blocks = paper_names();
  blocks.emplace_back("all", "All");
  // The paper prints unstructured figures for two context blocks alone.
  const std::size_t context = instances.empty() ? 0 : instances.front().context.objects.size();
  const bool printed = name != "unstructured" || context == 2;
  nlohmann::json rows = nlohmann::json::array();
  Rng rng = make_rng(seed, 0xb007);
  for (const Column& column : columns_of(name)) {
    for (const auto& [shape, block] : blocks) {
      std::vector<std::size_t> chosen;
      for (std::size_t i = 0; i < instances.size(); ++i) {
        if (shape == "all" || instances[i].query->name == shape) chosen.push_back(i);
      }
      if (chosen.empty()) continue;
      const PaperFigures paper = printed ? figures_of(column.paper, shape) : PaperFigures{kNone, kNone, kNone};
      rows.push_back(make_row(block, column, paper, outcomes, chosen, seed, rng));
    }
  }
  return rows;
}

nlohmann::json ablation_rows(const std::vector<Instance>& instances, const std::vector<Variant>& variants,
                             std::uint64_t seed) {
  std::vector<Column> columns = {{"Trans. Displ. (%)", kAblationTranslation, false, translation},
                                 {"Rot. Displ. (deg)", kAblationRotation, false, rotation},
                                 {"Stable at 10 % and 10 deg (%)", {}, true, stable_pct}};
  std::vector<std::size_t> all(instances.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  nlohmann::json rows = nlohmann::json::array();
  Rng rng = make_rng(seed, 0xb007);
  for (const Column& column : columns)
    for (const Variant& variant : variants)
      rows.push_back(
          make_row(variant.name, column, figures_of(column.paper, variant.name), variant.outcomes, all, seed, rng));
  return rows;
}

std::string format_rows(const nlohmann::json& rows) {
  const auto text = [](const nlohmann::json& value) {
    if (value.is_null()) return std::string("-");
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, value.get<double>() < 10.0 ? "%.2f" : "%.1f", value.get<double>());
    return std::string(buffer);
  };
  const auto with_interval = [&](const nlohmann::json& row, const std::string& key) {
    if (row[key].is_null()) return std::string("-");
    return text(row[key]) + " (" + text(row[key + "_95"][0]) + " .. " + text(row[key + "_95"][1]) + ")";
  };
  std::string out, column;
  char line[320];
  for (const auto& row : rows) {
    if (row["column"] != column) {
      column = row["column"];
      std::snprintf(line, sizeof line, "%s%s\n  %-16s %6s  %22s  %22s %8s | paper: %8s %8s %8s\n",
                    out.empty() ? "" : "\n", column.c_str(), "block", "n", "dofusion (95 %)", "held-out shape",
                    "random", "seen", "held out", "random");
      out += line;
    }
    std::snprintf(line, sizeof line, "  %-16s %6ld  %22s  %22s %8s |        %8s %8s %8s\n",
                  row["block"].get<std::string>().c_str(), row["instances"].get<long>(),
                  with_interval(row, "dofusion").c_str(), with_interval(row, "dofusion_ood").c_str(),
                  text(row["random"]).c_str(), text(row["paper"]).c_str(), text(row["paper_ood"]).c_str(),
                  text(row["paper_random"]).c_str());
    out += line;
  }
  return out;
}

}  // namespace dofusion
