// The perception-noise robustness study.
#include <cstdio>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "apps/study.h"
#include "apps/study_cases.h"
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
      "in the recovered and in the true scene.\n\nExamples:\n"
      "  dofusion-study --trials 200 --seed 0 --out study\n"
      "  dofusion-study --config study.json --trials 5000 --out study\n"
      "  mpirun -n 2 dofusion-study --config study.json --trials 5000 --out study\n\n"
      "All fields of the configuration, with their defaults:\n"
      "  {\"sensor\": \"realsense\", \"distance_m\": 0.7, \"known\": true, \"views\": 1,\n"
      "   \"pose_error\": [0, 0], \"series\": [],\n"
      "   \"noise_scales\": [0, 1, 2, 4],\n"
      "   \"tasks\": [{\"task\": \"single\", \"objects\": 1}, {\"task\": \"unstructured\", \"objects\": 2}],\n"
      "   \"samples\": 8, \"steps\": 50}\n"
      "and \"model\", a file relative to the configuration's folder; default: the shipped one.\n"
      "Every scene is tried under each series too; a series says what differs, any of sensor, distance_m, views,\n"
      "pose_error, known and model:\n"
      "  {\"series\": [{\"known\": false}, {\"distance_m\": 1}, {\"views\": 3, \"pose_error\": [0.2, 1]}]}\n"
      "pose_error: degrees and millimetres between where the robot believes a camera to be and where it is (standard\n"
      "deviations about and along each axis, times the noise scale).",
      "dofusion-study"};
  std::string config_path, out, model, json;
  StudyJob job;
  job.threads = default_rank_threads();
  app.add_option("--config", config_path, "JSON file, see above; fields that it lacks keep their defaults");
  app.add_option("--trials", job.trials, "in all; a scene has one for each series and noise scale")
      ->check(CLI::Range(1, 100'000'000))
      ->capture_default_str();
  app.add_option("--model", model, "a model file instead of the configuration's, in all series");
  app.add_option("--seed", job.seed, "the same seed gives the same trials on any number of threads and machines")
      ->capture_default_str();
  app.add_option("--threads", job.threads, "of this process")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", json, "write summary.json here as well");
  app.add_option("--out", out,
                 "folder for trials.csv, summary.json, pictures and report.html; after a kill the same command goes "
                 "on from DIR.partial.csv")
      ->required();

  const auto body = [&] {
    Ranks ranks;
    if (!config_path.empty()) job.config = read_study_config(config_path);
    if (!model.empty())
      for (StudyCondition& condition : job.config.series) condition.model = model;
    if (!ranks.first()) return help_to_study(ranks, job);
    const std::string settings = study_settings(job);
    job.partial = partial_file(out);
    // What cannot be written fails before the work.
    { const OutputDirectory writable(out); }
    std::filesystem::create_directories(std::filesystem::absolute(job.partial).parent_path());
    if (!json.empty()) check_writable(json);

    const std::vector<StudyRow> rows = run_study(ranks, job);
    const StudySummary figures = summarise(rows, job.config, job.seed);
    OutputDirectory output(out);
    write_study(output.path().string(), rows, figures, job.config, settings, job.seed);
    write_file((output.path() / "worst.html").string(), cases_html(job, worst_cases(rows)));
    output.commit();
    if (!json.empty()) write_file(json, to_json(figures, settings).dump(2) + "\n");
    std::error_code ignored;
    std::filesystem::remove(job.partial, ignored);
    summary(study_text(figures) + "report: " + out + "/report.html; the worst trials: " + out + "/worst.html\n");
  };
  return run_program(app, argc, argv, body, rank_from_environment() == 0);
}
