// Medians, shares and their bootstrap intervals over a study's rows.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/study_config.h"
#include "apps/study_rows.h"
#include "stability/metrics.h"

namespace dofusion {

struct Estimate {
  double value = 0.0;  // NaN if there is nothing to estimate from, infinite if the median trial has no finite value
  Interval interval;   // bootstrap, 95 %
  int count = 0;       // values it is made of
};

// All trials of one series at one noise scale.
struct StudyPoint {
  double noise_scale = 0.0;
  double depth_sigma_mm = 0.0;
  int trials = 0;
  std::map<std::string, Estimate> medians;  // by column of trials.csv
  std::map<std::string, Estimate> shares;   // 0 … 1: stable_recovered, stable_true, objects_right, shapes_right
  std::map<std::string, Estimate> stable_by_task;  // 0 … 1, of stable_true, by task_title()
  std::map<std::string, double> failures;  // 0 … 1, by failure_names(); with the share of stable_true they make 1
};

struct StudySeries {
  std::string title;               // series_title()
  std::vector<StudyPoint> points;  // by ascending noise scale
};

// A reference: every scene once.
struct StudyReference {
  Estimate pct, deg, stable;
};

struct StudySummary {
  int trials = 0, scenes = 0;
  std::vector<StudySeries> series;  // as in the configuration
  StudyReference ground_truth, random;
  std::map<std::string, StudyReference> ground_truth_by_task;  // by task_title()

  const std::vector<StudyPoint>& base() const { return series.front().points; }
};

// A trial without a displacement, because nothing was placed or the simulation diverged, counts as larger than any;
// in the other medians a row without the value does not count. The seed is the bootstrap's.
StudySummary summarise(const std::vector<StudyRow>& rows, const StudyConfig& config, std::uint64_t seed);

// summary.json; `settings` is study_settings' text. Numbers that are not finite become null.
nlohmann::ordered_json to_json(const StudySummary& summary, const std::string& settings);

}  // namespace dofusion
