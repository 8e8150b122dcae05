// What a study leaves: trials.csv, summary.json, its figures and report.html.
#pragma once

#include <string>
#include <vector>

#include "apps/study_config.h"
#include "apps/study_rows.h"
#include "apps/study_summary.h"

namespace dofusion {

std::string trials_csv(const std::vector<StudyRow>& rows);

// One page with the figures, the summary as tables, and what was done; opens without a network.
std::string study_html(const StudySummary& summary, const StudyConfig& config, std::uint64_t seed);

// Writes all of it into `directory`, which must exist; `settings` is study_settings' text.
void write_study(const std::string& directory, const std::vector<StudyRow>& rows, const StudySummary& summary,
                 const StudyConfig& config, const std::string& settings, std::uint64_t seed);

// A few lines for the terminal.
std::string study_text(const StudySummary& summary);

}  // namespace dofusion
