// The perception-noise study: many trials, under growing noise.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/ranks.h"
#include "apps/study_config.h"
#include "apps/study_rows.h"

namespace dofusion {

struct StudyJob {
  StudyConfig config;
  std::int64_t trials = 200;
  std::uint64_t seed = 0;
  int threads = 1;
  std::string partial;  // file for the rows while the study runs; of the first rank
};

// What identifies a study besides the number of trials, as JSON in one line: configuration, seed and the model files'
// hashes. A partial file of other settings is refused.
std::string study_settings(const StudyJob& job);

// On the first rank: runs the trials that the partial file lacks, with all ranks that help. Returns all rows, by trial.
// Throws Interrupted after Ctrl-C; the partial file then holds every finished scene's trials.
std::vector<StudyRow> run_study(Ranks& ranks, const StudyJob& job);

// On every other rank, with the same job.
void help_to_study(Ranks& ranks, const StudyJob& job);

}  // namespace dofusion
