// The perception-noise robustness study.
#include <cstdio>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "apps/study.h"
#include "apps/study_report.h"
#include "stability/files.h"

using namespace dofusion;

namespace {

// DIR.partial.csv, beside DIR.
std::string partial_file(const std::string& out) {
  std::filesystem::path path = std::filesystem::absolute(out).lexically_normal();
  if (path.filename().empty()) path = path.parent_path();
  return path.string() + ".partial.csv";
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Measures what sensor noise costs: generates scenes, scans, recovers, places, and settles the best placement "
      "in the recovered and in the true scene.\n\nExamples:\n  dofusion-study --trials 200 --seed 0 --out study\n"
      "  dofusion-study --config study.json --trials 5000 --out study\n\nAll fields of the configuration, with "
      "their defaults:\n  {\"sensor\": \"realsense\", \"noise_scales\": [0, 1, 2, 4], \"distance_m\": 0.7, \"known\": "
      "true,\n"
      "   \"tasks\": [{\"task\": \"single\", \"objects\": 1}, {\"task\": \"unstructured\", \"objects\": 2}],\n"
      "   \"samples\": 8, \"steps\": 50}\nand \"model\", a file relative to the configuration's folder; default: the "
      "shipped one.",
      "dofusion-study"};
  std::string config_path, out, model, json;
  StudyJob job;
  job.threads = default_threads();
  app.add_option("--config", config_path, "JSON file, see above; fields that it lacks keep their defaults");
  app.add_option("--trials", job.trials, "in all; trial i is scene i/4 at the noise scale i mod 4")
      ->check(CLI::Range(1, 100'000'000))
      ->capture_default_str();
  app.add_option("--model", model, "a model file instead of the configuration's");
  app.add_option("--seed", job.seed, "the same seed gives the same trials on any number of threads")
      ->capture_default_str();
  app.add_option("--threads", job.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", json, "write summary.json here as well");
  app.add_option("--out", out,
                 "folder for trials.csv, summary.json, displacement.svg and report.html; after a kill the "
                 "same command goes on from DIR.partial.csv")
      ->required();

  return run_program(app, argc, argv, [&] {
    if (!config_path.empty()) job.config = read_study_config(config_path);
    if (!model.empty()) job.config.model = model;
    const std::string settings = study_settings(job);
    job.partial = partial_file(out);
    // What cannot be written fails before the work.
    { const OutputDirectory writable(out); }
    std::filesystem::create_directories(std::filesystem::absolute(job.partial).parent_path());
    if (!json.empty() && !std::filesystem::is_directory(std::filesystem::absolute(json).parent_path())) {
      throw InputError(json + ": cannot be written; its folder does not exist");
    }

    const std::vector<StudyRow> rows = run_study(job);
    const StudySummary summary = summarise(rows, job.config, job.seed);
    OutputDirectory output(out);
    write_study(output.path().string(), rows, summary, job.config, settings, job.seed);
    output.commit();
    if (!json.empty()) write_file(json, to_json(summary, settings).dump(2) + "\n");
    std::error_code ignored;
    std::filesystem::remove(job.partial, ignored);
    std::printf("%sreport: %s/report.html\n", study_text(summary).c_str(), out.c_str());
  });
}
