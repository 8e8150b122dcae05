#include "apps/study_summary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include <nlohmann/json.hpp>

#include "stability/random.h"

namespace dofusion {
namespace {

using Rows = std::vector<StudyRow>;
using Value = std::optional<double> (*)(const StudyRow&);

struct Quantity {
  const char* name;
  Value value;
  bool missing_is_infinite = false;
};

const std::vector<Quantity>& medians() {
  static const std::vector<Quantity> list = {
      {"displacement_recovered_pct", [](const StudyRow& r) { return r.displacement_recovered_pct; }, true},
      {"displacement_recovered_deg", [](const StudyRow& r) { return r.displacement_recovered_deg; }, true},
      {"displacement_true_pct", [](const StudyRow& r) { return r.displacement_true_pct; }, true},
      {"displacement_true_deg", [](const StudyRow& r) { return r.displacement_true_deg; }, true},
      {"position_error_mean_mm", [](const StudyRow& r) { return r.position_error_mean_mm; }},
      {"position_error_max_mm", [](const StudyRow& r) { return r.position_error_max_mm; }},
      {"pose_error_max_pct", [](const StudyRow& r) { return r.pose_error_max_pct; }},
      {"table_angle_deg", [](const StudyRow& r) { return r.table_angle_deg; }},
      {"table_offset_mm", [](const StudyRow& r) { return r.table_offset_mm; }},
      {"ms_recover", [](const StudyRow& r) { return std::optional<double>(r.ms_recover); }},
      {"ms_place", [](const StudyRow& r) { return r.ms_place; }},
  };
  return list;
}

std::optional<double> share_of(bool yes) { return yes ? 1.0 : 0.0; }

Quantity stable_true() {
  return {"stable_true", [](const StudyRow& r) { return share_of(r.stable_true.value_or(false)); }};
}

const std::vector<Quantity>& shares() {
  static const std::vector<Quantity> list = {
      {"stable_recovered", [](const StudyRow& r) { return share_of(r.stable_recovered.value_or(false)); }},
      stable_true(),
      {"objects_right", [](const StudyRow& r) { return share_of(r.objects_found == r.objects_true); }},
      {"shapes_right",
       [](const StudyRow& r) {
         return r.known ? share_of(r.shapes_right == r.objects_true) : std::optional<double>();
       }},
  };
  return list;
}

std::vector<double> values_of(const Rows& rows, const Quantity& quantity) {
  std::vector<double> values;
  for (const StudyRow& row : rows) {
    const std::optional<double> value = quantity.value(row);
    if (value)
      values.push_back(*value);
    else if (quantity.missing_is_infinite)
      values.push_back(std::numeric_limits<double>::infinity());
  }
  return values;
}

Estimate median_of(const Rows& rows, const Quantity& quantity, Rng& rng) {
  const std::vector<double> values = values_of(rows, quantity);
  return {median(values), bootstrap_median(values, rng), static_cast<int>(values.size())};
}

Estimate mean_of(const Rows& rows, const Quantity& quantity, Rng& rng) {
  const std::vector<double> values = values_of(rows, quantity);
  const double sum = std::accumulate(values.begin(), values.end(), 0.0);
  const double mean = values.empty() ? std::nan("") : sum / static_cast<double>(values.size());
  return {mean, bootstrap_mean(values, rng), static_cast<int>(values.size())};
}

// The rows of each of the configuration's tasks, by title; scene i has task i modulo their number.
std::map<std::string, Rows> by_task(const Rows& rows, const StudyConfig& config) {
  std::map<std::string, Rows> parts;
  for (const StudyRow& row : rows)
    parts[task_title(config.tasks[static_cast<std::size_t>(row.scene) % config.tasks.size()])].push_back(row);
  return parts;
}

StudyPoint point_of(const Rows& rows, double noise_scale, const StudyConfig& config, const StudyCondition& condition,
                    Rng& rng) {
  StudyPoint point;
  point.noise_scale = noise_scale;
  point.depth_sigma_mm = depth_sigma_mm(condition, noise_scale);
  point.trials = static_cast<int>(rows.size());
  for (const Quantity& quantity : medians()) point.medians[quantity.name] = median_of(rows, quantity, rng);
  for (const Quantity& quantity : shares()) point.shares[quantity.name] = mean_of(rows, quantity, rng);
  for (const StudyTask& task : config.tasks) point.stable_by_task[task_title(task)] = mean_of({}, stable_true(), rng);
  for (const auto& [task, part] : by_task(rows, config)) point.stable_by_task[task] = mean_of(part, stable_true(), rng);
  for (const std::string& failure : failure_names()) point.failures[failure] = 0.0;
  for (const StudyRow& row : rows) {
    if (!row.failure.empty()) point.failures[row.failure] += 1.0 / static_cast<double>(rows.size());
  }
  return point;
}

StudyReference ground_truth_of(const Rows& scenes, Rng& rng) {
  return {median_of(scenes, {"", [](const StudyRow& r) { return r.displacement_ground_truth_pct; }, true}, rng),
          median_of(scenes, {"", [](const StudyRow& r) { return r.displacement_ground_truth_deg; }, true}, rng),
          mean_of(scenes, {"", [](const StudyRow& r) { return share_of(r.stable_ground_truth); }}, rng)};
}

StudyReference random_of(const Rows& scenes, Rng& rng) {
  return {median_of(scenes, {"", [](const StudyRow& r) { return r.displacement_random_pct; }, true}, rng),
          median_of(scenes, {"", [](const StudyRow& r) { return r.displacement_random_deg; }, true}, rng),
          mean_of(scenes, {"", [](const StudyRow& r) { return share_of(r.stable_random); }}, rng)};
}

nlohmann::ordered_json number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

nlohmann::ordered_json to_json(const Estimate& e, const char* statistic) {
  return {{statistic, number(e.value)},
          {"low", number(e.interval.low)},
          {"high", number(e.interval.high)},
          {"count", e.count}};
}

nlohmann::ordered_json to_json(const StudyReference& reference) {
  return {{"displacement_pct", to_json(reference.pct, "median")},
          {"displacement_deg", to_json(reference.deg, "median")},
          {"stable", to_json(reference.stable, "share")}};
}

nlohmann::ordered_json to_json(const StudyPoint& point) {
  nlohmann::ordered_json json = {
      {"noise_scale", point.noise_scale}, {"depth_sigma_mm", point.depth_sigma_mm}, {"trials", point.trials}};
  for (const Quantity& q : medians()) json[q.name] = to_json(point.medians.at(q.name), "median");
  for (const Quantity& q : shares()) json[q.name] = to_json(point.shares.at(q.name), "share");
  for (const auto& [task, share] : point.stable_by_task) json["stable_true_by_task"][task] = to_json(share, "share");
  for (const std::string& failure : failure_names()) json["failures"][failure] = point.failures.at(failure);
  return json;
}

}  // namespace

StudySummary summarise(const std::vector<StudyRow>& rows, const StudyConfig& config, std::uint64_t seed) {
  StudySummary summary;
  summary.trials = static_cast<int>(rows.size());
  Rng rng = make_rng(seed, 0x626f6f74ull);
  for (std::size_t s = 0; s < config.series.size(); ++s) {
    StudySeries& series = summary.series.emplace_back();
    series.title = series_title(config, s);
    for (const double scale : config.noise_scales) {
      Rows chosen;
      for (const StudyRow& row : rows) {
        // By what the file says of the scale, which is rounded.
        const bool here = std::abs(row.noise_scale - scale) <= 1e-5 * std::max(1.0, scale);
        if (here && row.series == static_cast<int>(s)) chosen.push_back(row);
      }
      if (!chosen.empty()) series.points.push_back(point_of(chosen, scale, config, config.series[s], rng));
    }
  }
  Rows scenes;
  std::set<std::int64_t> seen;
  for (const StudyRow& row : rows) {
    if (seen.insert(row.scene).second) scenes.push_back(row);
  }
  summary.scenes = static_cast<int>(scenes.size());
  summary.ground_truth = ground_truth_of(scenes, rng);
  summary.random = random_of(scenes, rng);
  if (config.tasks.size() > 1)
    for (const auto& [task, part] : by_task(scenes, config))
      summary.ground_truth_by_task[task] = ground_truth_of(part, rng);
  return summary;
}

nlohmann::ordered_json to_json(const StudySummary& summary, const std::string& settings) {
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(settings);
  json["trials"] = summary.trials;
  json["scenes"] = summary.scenes;
  json["references"] = {{"ground_truth", to_json(summary.ground_truth)}, {"random", to_json(summary.random)}};
  for (const auto& [task, reference] : summary.ground_truth_by_task)
    json["references"]["ground_truth_by_task"][task] = to_json(reference);
  json["series"] = nlohmann::ordered_json::array();
  for (const StudySeries& series : summary.series) {
    nlohmann::ordered_json points = nlohmann::ordered_json::array();
    for (const StudyPoint& point : series.points) points.push_back(to_json(point));
    json["series"].push_back({{"title", series.title}, {"noise", points}});
  }
  return json;
}

}  // namespace dofusion
