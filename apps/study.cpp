#include "apps/study.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <sstream>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "apps/shared_work.h"
#include "apps/study_runner.h"
#include "stability/files.h"

namespace dofusion {
namespace {

// 64-bit FNV-1a, to tell model files apart.
std::string hash_of(const std::string& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

// The trials of a scene below the job's number, as lines of trials.csv.
std::string run_scene(StudyRunner& runner, const StudyJob& job, std::int64_t index) {
  const std::int64_t begin = index * job.config.trials_per_scene();
  const std::int64_t end = std::min(begin + job.config.trials_per_scene(), job.trials);
  const StudyScene scene = runner.make_scene(index);
  const StudyRow reference = runner.reference_row(scene);
  std::string lines;
  for (std::int64_t trial = begin; trial < end; ++trial) {
    lines += to_csv_line(runner.run(scene, trial, reference).row);
  }
  return lines;
}

// A scene with all its trials is one piece of work: its references are needed once.
Work work_of(const StudyJob& job, const StudyModels& models) {
  auto runners = std::make_shared<std::vector<std::unique_ptr<StudyRunner>>>();
  const std::vector<ObjectPtr> library = load_block_library();
  for (int t = 0; t < job.threads; ++t)
    runners->push_back(std::make_unique<StudyRunner>(job.config, job.seed, models, library));
  return [runners, job](std::int64_t index, int thread) {
    return run_scene(*(*runners)[static_cast<std::size_t>(thread)], job, index);
  };
}

std::vector<std::int64_t> unfinished_scenes(const StudyJob& job, const PartialRows& rows) {
  const std::int64_t each = job.config.trials_per_scene();
  std::vector<std::int64_t> scenes;
  for (std::int64_t scene = 0; scene * each < job.trials; ++scene) {
    bool whole = true;
    for (std::int64_t t = scene * each; t < std::min((scene + 1) * each, job.trials); ++t) whole = whole && rows.has(t);
    if (!whole) scenes.push_back(scene);
  }
  return scenes;
}

// The same on all ranks.
std::string job_text(const StudyJob& job) { return study_settings(job) + " trials " + std::to_string(job.trials); }

void add_lines(const std::string& lines, PartialRows& rows) {
  std::istringstream stream(lines);
  for (std::string line; std::getline(stream, line);) {
    const std::optional<StudyRow> row = row_from_csv_line(line);
    if (!row) throw std::runtime_error("a rank sent a row that cannot be read; is it another version?");
    if (!rows.has(row->trial)) rows.add(*row);
  }
}

}  // namespace

std::string study_settings(const StudyJob& job) {
  nlohmann::ordered_json settings = {{"format", "dofusion-study"}, {"version", 3}, {"seed", job.seed}};
  settings["configuration"] = to_json(job.config);
  for (const StudyCondition& condition : job.config.series)
    settings["models_fnv1a"].push_back(hash_of(read_file(model_path(condition))));
  return settings.dump();
}

std::vector<StudyRow> run_study(Ranks& ranks, const StudyJob& job) {
  const StudyModels models(job.config);
  PartialRows rows(job.partial, study_settings(job));
  const std::int64_t before = rows.count(job.trials);
  if (before > 0) {
    note("continuing with the " + std::to_string(before) + " trials of " + job.partial);
  }
  try {
    Progress progress("trials", job.trials, before);
    const auto collect = [&](std::int64_t, const std::string& lines) {
      add_lines(lines, rows);
      progress.update(rows.count(job.trials));
    };
    share_work(ranks, {job_text(job), unfinished_scenes(job, rows), work_of(job, models), collect, job.threads});
  } catch (const Interrupted&) {
    throw Interrupted("interrupted after " + std::to_string(rows.count(job.trials)) + " of " +
                      std::to_string(job.trials) + " trials; the same command goes on from " + job.partial);
  }
  return rows.rows(job.trials);
}

void help_to_study(Ranks& ranks, const StudyJob& job) {
  std::unique_ptr<StudyModels> models;
  serve(ranks, job.threads, [&](const std::string& text) {
    if (text != job_text(job)) throw InputError("has another study than the first rank; is it another version?");
    models = std::make_unique<StudyModels>(job.config);
    return work_of(job, *models);
  });
}

}  // namespace dofusion
