#include "apps/study.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "apps/assets.h"
#include "apps/study_cases.h"
#include "apps/study_figures.h"
#include "apps/study_report.h"
#include "apps/study_runner.h"
#include "stability/files.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

StudyRow made_up_row(std::int64_t trial, double noise_scale) {
  StudyRow row;
  row.trial = trial;
  row.scene = trial / 2;
  row.noise_scale = noise_scale;
  row.sensor = "realsense";
  row.distance_m = 0.7;
  row.known = true;
  row.task = "unstructured";
  row.context = "cube+hat";
  row.query = "tetrahedron";
  row.objects_true = 2;
  row.fewest_pixels = 1234;
  row.objects_found = 2;
  row.shapes_right = 2;
  row.position_error_mean_mm = 0.5;
  row.position_error_max_mm = 0.75;
  row.pose_error_max_pct = 1.25;
  row.table_angle_deg = 0.01;
  row.table_offset_mm = 1.0 / 3.0;
  row.candidates_stable = 5;
  row.displacement_recovered_pct = 0.01;
  row.displacement_recovered_deg = 0.02;
  row.stable_recovered = true;
  row.displacement_true_pct = 0.5;
  row.displacement_true_deg = 0.25;
  row.stable_true = true;
  row.displacement_ground_truth_pct = 0.125;
  row.displacement_ground_truth_deg = 0.25;
  row.stable_ground_truth = true;
  row.displacement_random_pct = 90.0;
  row.displacement_random_deg = 60.0;
  row.ms_recover = 800.0;
  row.ms_place = 700.0;
  return row;
}

// A trial in which no table was found.
StudyRow without_table(StudyRow row) {
  StudyRow bare;
  bare.trial = row.trial;
  bare.scene = row.scene;
  bare.noise_scale = row.noise_scale;
  bare.known = row.known;
  bare.objects_true = row.objects_true;
  bare.failure = first_failure(bare);
  return bare;
}

std::string error_of(const std::string& json) {
  try {
    study_config_from_json(json, "study.json");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(StudyConfig, DefaultsAndOwnValues) {
  const StudyConfig plain = study_config_from_json("{}", "study.json");
  EXPECT_EQ(plain.noise_scales, (std::vector<double>{0, 1, 2, 4}));
  ASSERT_EQ(plain.series.size(), 1u);
  EXPECT_TRUE(plain.base().known);
  ASSERT_EQ(plain.tasks.size(), 2u);

  const StudyConfig own = study_config_from_json(
      R"({"sensor": "kinect2", "noise_scales": [0.5, 3], "distance_m": 1, "known": false, "samples": 16, "steps": 20,
          "tasks": [{"task": "stack", "objects": 3}], "model": "m.safetensors"})",
      "study.json");
  EXPECT_EQ(own.base().sensor, SensorModel::kKinect2);
  EXPECT_EQ(own.noise_scales, (std::vector<double>{0.5, 3}));
  EXPECT_EQ(own.base().distance_m, 1.0);
  EXPECT_FALSE(own.base().known);
  EXPECT_EQ(own.tasks.at(0).task, Task::kStack);
  EXPECT_EQ(own.tasks.at(0).objects, 3);
  EXPECT_EQ(own.base().model, "m.safetensors");
}

TEST(StudyConfig, ASeriesSaysWhatDiffersFromTheFirst) {
  const StudyConfig config = study_config_from_json(
      R"({"sensor": "kinect", "distance_m": 1, "noise_scales": [0, 1],
          "series": [{"known": false}, {"sensor": "azure", "distance_m": 0.5}, {"views": 3, "pose_error": [0.2, 1.5]}]})",
      "study.json");
  ASSERT_EQ(config.series.size(), 4u);
  EXPECT_EQ(config.trials_per_scene(), 8);
  EXPECT_EQ(config.series[1].sensor, SensorModel::kKinect);
  EXPECT_EQ(config.series[1].distance_m, 1.0);
  EXPECT_FALSE(config.series[1].known);
  EXPECT_EQ(config.series[2].sensor, SensorModel::kAzure);
  EXPECT_TRUE(config.series[2].known);
  EXPECT_EQ(series_title(config, 0), "known objects, the first Kinect, at 1 m");
  EXPECT_EQ(series_title(config, 1), "unknown objects");
  EXPECT_EQ(series_title(config, 2), "the Azure Kinect, at 0.5 m");
  EXPECT_EQ(config.series[3].views, 3);
  EXPECT_EQ(config.series[3].pose_error_deg, 0.2);
  EXPECT_EQ(config.series[3].pose_error_mm, 1.5);
  EXPECT_EQ(series_title(config, 3), "3 views, camera poses off by 0.2° and 1.5 mm");
}

TEST(StudyConfig, ErrorsNameFileAndField) {
  EXPECT_THAT(error_of("{"), HasSubstr("study.json"));
  EXPECT_THAT(error_of("[]"), HasSubstr("study.json"));
  const std::vector<std::pair<std::string, std::string>> cases = {
      {R"({"senser": "kinect"})", "senser"},
      {R"({"sensor": "camera"})", "sensor"},
      {R"({"sensor": 3})", "sensor"},
      {R"({"noise_scales": []})", "noise_scales"},
      {R"({"noise_scales": [1, 1]})", "noise_scales"},
      {R"({"noise_scales": [-1]})", "noise_scales"},
      {R"({"distance_m": "far"})", "distance_m"},
      {R"({"distance_m": 0})", "distance_m"},
      {R"({"known": 1})", "known"},
      {R"({"views": 0})", "views"},
      {R"({"views": 9})", "views"},
      {R"({"pose_error": [1]})", "pose_error"},
      {R"({"pose_error": [-1, 0]})", "pose_error"},
      {R"({"series": [{"pose_error": [0.1, 2, 3]}]})", "series[0].pose_error"},
      {R"({"samples": 0})", "samples"},
      {R"({"steps": 1.5})", "steps"},
      {R"({"model": ""})", "model"},
      {R"({"series": {}})", "series"},
      {R"({"series": [{}]})", "series[0]"},
      {R"({"series": [{"known": false}, {"known": false}]})", "series[1]"},
      {R"({"series": [{"sensor": "eye"}]})", "series[0].sensor"},
      {R"({"series": [{"steps": 3}]})", "series[0].steps"},
      {R"({"tasks": []})", "tasks"},
      {R"({"tasks": [{"objects": 2}]})", "tasks[0].task"},
      {R"({"tasks": [{"task": "single"}, {"task": "heap", "objects": 2}]})", "tasks[1].task"},
      {R"({"tasks": [{"task": "stack", "objects": 1}]})", "tasks[0].objects"},
      {R"({"tasks": [{"task": "single", "colour": "red"}]})", "tasks[0].colour"},
      {R"({"tasks": [{"task": "single", "on_top": 1}]})", "tasks[0].on_top"},
  };
  for (const auto& [json, field] : cases) {
    EXPECT_THAT(error_of(json), AllOf(HasSubstr("study.json"), HasSubstr("'" + field + "'"))) << json;
  }
}

TEST(StudyConfig, ModelIsRelativeToTheFile) {
  const TemporaryDirectory directory;
  write_file(directory / "study.json", R"({"model": "models/mine.safetensors"})");
  EXPECT_EQ(read_study_config(directory / "study.json").base().model, directory / "models/mine.safetensors");
  EXPECT_THROW(read_study_config(directory / "none.json"), InputError);
}

TEST(StudyRows, SurviveCsv) {
  for (const StudyRow& row : {made_up_row(7, 4.0), without_table(made_up_row(3, 0.1))}) {
    const std::string line = to_csv_line(row);
    const auto read = row_from_csv_line(line.substr(0, line.size() - 1));
    ASSERT_TRUE(read);
    EXPECT_EQ(to_csv_line(*read), line);
    EXPECT_EQ(read->trial, row.trial);
    EXPECT_EQ(read->noise_scale, row.noise_scale);
    EXPECT_EQ(read->stable_true, row.stable_true);
    EXPECT_EQ(read->position_error_mean_mm, row.position_error_mean_mm);
  }
  const std::string line = to_csv_line(without_table(made_up_row(0, 1.0)));
  EXPECT_THAT(line, HasSubstr(",table,"));
  EXPECT_FALSE(row_from_csv_line("1,2,3"));
  EXPECT_FALSE(row_from_csv_line("x" + line.substr(0, line.size() - 1)));
}

TEST(FirstFailure, NamesTheFirstStepThatWentWrong) {
  StudyRow row = made_up_row(0, 1.0);
  row.pose_error_max_pct = 20.0;
  EXPECT_EQ(first_failure(row), "");  // it stands
  row.stable_true = false;
  EXPECT_EQ(first_failure(row), "pose");
  row.shapes_right = 1;
  EXPECT_EQ(first_failure(row), "shape");
  row.objects_found = 3;
  EXPECT_EQ(first_failure(row), "segmentation");
  row.table_angle_deg.reset();
  EXPECT_EQ(first_failure(row), "table");
  row = made_up_row(0, 1.0);
  row.stable_true = false;
  EXPECT_EQ(first_failure(row), "placement");
}

// Of each kind the ones at the sensor's own noise first, then the larger displacement, a scene but once.
TEST(WorstCases, AreTheNearestToOwnNoiseInWhichMostMoved) {
  std::vector<StudyRow> rows;
  const auto add = [&](std::int64_t scene, double scale, std::optional<double> moved, const std::string& failure) {
    StudyRow row = made_up_row(static_cast<std::int64_t>(rows.size()), scale);
    row.scene = scene;
    row.displacement_true_pct = moved;
    row.failure = failure;
    rows.push_back(row);
  };
  add(0, 1.0, 90.0, "placement");
  add(0, 1.0, 80.0, "placement");  // the same scene again
  add(1, 4.0, 95.0, "placement");
  add(2, 1.0, 20.0, "placement");
  add(3, 1.0, {}, "placement");  // diverged: more than any
  add(4, 0.0, 99.0, "shape");
  add(5, 1.0, 0.1, "");
  std::vector<std::int64_t> trials;
  for (const StudyRow& row : worst_cases(rows, 3)) trials.push_back(row.trial);
  EXPECT_EQ(trials, (std::vector<std::int64_t>{5, 4, 0, 3}));
}

TEST(PartialRows, GoOnAfterACutLine) {
  const TemporaryDirectory directory;
  const std::string file = directory / "study.partial.csv", settings = R"({"seed": 1})";
  {
    PartialRows rows(file, settings);
    for (const int trial : {2, 0, 1}) rows.add(made_up_row(trial, trial));
  }
  const std::string whole = read_file(file);
  write_file(file, whole.substr(0, whole.size() - 20));  // the last row, of trial 1, is cut

  PartialRows rows(file, settings);
  EXPECT_TRUE(rows.has(0));
  EXPECT_FALSE(rows.has(1));
  EXPECT_TRUE(rows.has(2));
  rows.add(made_up_row(1, 1.0));
  EXPECT_EQ(rows.count(2), 2);
  EXPECT_EQ(trials_csv(rows.rows(3)), trials_csv({made_up_row(0, 0.0), made_up_row(1, 1.0), made_up_row(2, 2.0)}));
  EXPECT_EQ(trials_csv(PartialRows(file, settings).rows(3)), trials_csv(rows.rows(3)));
}

TEST(PartialRows, RefuseOtherSettingsAndDamage) {
  const TemporaryDirectory directory;
  const std::string file = directory / "study.partial.csv";
  { PartialRows(file, "{1}").add(made_up_row(0, 0.0)); }
  EXPECT_THROW(PartialRows(file, "{2}"), InputError);
  write_file(file, read_file(file) + "nonsense\n");
  EXPECT_THROW(PartialRows(file, "{1}"), InputError);
  EXPECT_THROW(PartialRows(directory / "none/study.partial.csv", "{1}"), InputError);
}

// Two scenes at two scales; one trial has no table.
std::vector<StudyRow> four_rows() {
  std::vector<StudyRow> rows = {made_up_row(0, 0.0), made_up_row(1, 1.0), made_up_row(2, 0.0), made_up_row(3, 1.0)};
  rows[0].displacement_true_pct = 1.0;
  rows[2].displacement_true_pct = 3.0;
  rows[2].displacement_random_pct = 110.0;
  rows[2].stable_ground_truth = false;
  rows[3] = without_table(rows[3]);
  return rows;
}

TEST(StudySummary, IsWhatAHandWorksOut) {
  StudyConfig config;
  config.noise_scales = {0.0, 1.0, 2.0};
  const StudySummary summary = summarise(four_rows(), config, 0);
  EXPECT_EQ(summary.trials, 4);
  EXPECT_EQ(summary.scenes, 2);
  ASSERT_EQ(summary.base().size(), 2u);  // nothing was tried at 2

  const StudyPoint& exact = summary.base()[0];
  EXPECT_EQ(exact.trials, 2);
  EXPECT_DOUBLE_EQ(exact.medians.at("displacement_true_pct").value, 2.0);  // of 1 and 3
  EXPECT_GE(exact.medians.at("displacement_true_pct").interval.low, 1.0);
  EXPECT_LE(exact.medians.at("displacement_true_pct").interval.high, 3.0);
  EXPECT_DOUBLE_EQ(exact.shares.at("stable_true").value, 1.0);
  EXPECT_EQ(exact.depth_sigma_mm, 0.0);

  const StudyPoint& noisy = summary.base()[1];
  EXPECT_DOUBLE_EQ(noisy.shares.at("stable_true").value, 0.5);
  EXPECT_DOUBLE_EQ(noisy.shares.at("objects_right").value, 0.5);
  EXPECT_DOUBLE_EQ(noisy.failures.at("table"), 0.5);
  EXPECT_TRUE(std::isinf(noisy.medians.at("displacement_true_pct").value));  // one of two has none
  EXPECT_DOUBLE_EQ(noisy.medians.at("table_angle_deg").value, 0.01);         // of the one that has it
  EXPECT_EQ(noisy.medians.at("table_angle_deg").count, 1);
  EXPECT_NEAR(noisy.depth_sigma_mm, 1.85, 0.005);  // Intel's figure for a D435 at 0.7 m

  // Each scene once, whatever the number of its trials.
  EXPECT_DOUBLE_EQ(summary.random.pct.value, 100.0);
  EXPECT_EQ(summary.random.pct.count, 2);
  EXPECT_DOUBLE_EQ(summary.ground_truth.stable.value, 0.5);

  double sum = noisy.shares.at("stable_true").value;
  for (const auto& [name, share] : noisy.failures) sum += share;
  EXPECT_DOUBLE_EQ(sum, 1.0);
}

TEST(StudySummary, SeriesAreApart) {
  const StudyConfig config =
      study_config_from_json(R"({"noise_scales": [0, 1], "series": [{"known": false}]})", "study.json");
  std::vector<StudyRow> rows = four_rows();
  for (StudyRow& row : rows) {
    row.series = row.scene == 0 ? 0 : 1;
    row.displacement_true_pct = row.series == 0 ? 1.0 : 50.0;
  }
  const StudySummary summary = summarise(rows, config, 0);
  ASSERT_EQ(summary.series.size(), 2u);
  EXPECT_EQ(summary.series[1].title, "unknown objects");
  ASSERT_FALSE(summary.series[1].points.empty());
  EXPECT_DOUBLE_EQ(summary.series[0].points[0].medians.at("displacement_true_pct").value, 1.0);
  EXPECT_DOUBLE_EQ(summary.series[1].points[0].medians.at("displacement_true_pct").value, 50.0);
  const std::string html = study_html(summary, config, 0);
  EXPECT_THAT(html, AllOf(HasSubstr("side by side"), HasSubstr("Series: unknown objects")));
}

TEST(StudyReport, HasNoNumberWhereThereIsNone) {
  StudyConfig config;
  config.noise_scales = {0.0, 1.0};
  const StudySummary summary = summarise(four_rows(), config, 0);
  const nlohmann::ordered_json json = to_json(summary, R"({"format": "dofusion-study", "seed": 0})");
  EXPECT_EQ(json["trials"], 4);
  EXPECT_DOUBLE_EQ(json["series"][0]["noise"][0]["displacement_true_pct"]["median"].get<double>(), 2.0);
  EXPECT_TRUE(json["series"][0]["noise"][1]["displacement_true_pct"]["median"].is_null());

  const std::string svg = displacement_svg(summary, config);
  EXPECT_THAT(svg, AllOf(HasSubstr("<svg"), HasSubstr("random placement"), HasSubstr("</svg>")));
  const std::string html = study_html(summary, config, 0);
  for (const std::string& page : {svg, html, success_svg(summary, config)}) {
    EXPECT_EQ(page.find("nan"), std::string::npos);
    EXPECT_EQ(page.find("inf\""), std::string::npos);
  }
  EXPECT_EQ(html.find("http://"), html.find("http://www.w3.org/2000/svg"));  // nothing is loaded from elsewhere
  EXPECT_EQ(html.find("<script"), std::string::npos);
}

// The model that DOFUSION_TEST_MODEL names, or the shipped one.
std::string test_model() {
  const char* chosen = std::getenv("DOFUSION_TEST_MODEL");
  return chosen != nullptr ? chosen : std::string(DOFUSION_ASSETS_DIR) + "/models/default.safetensors";
}

// All but the two columns of times.
std::string without_times(std::string csv_line) {
  for (int k = 0; k < 2; ++k) csv_line.erase(csv_line.rfind(','));
  return csv_line;
}

TEST(Study, IsTheSameResumedAndOnTwoThreads) {
  if (!std::filesystem::exists(test_model())) GTEST_SKIP() << "no model at " << test_model();
  const TemporaryDirectory directory;
  Ranks ranks;
  StudyJob job;
  job.config.series[0].model = test_model();
  job.config.noise_scales = {0.0, 2.0};
  job.config.samples = 2;
  job.config.steps = 10;
  job.trials = 4;
  job.seed = 5;
  job.partial = directory / "whole.csv";
  const std::vector<StudyRow> whole = run_study(ranks, job);
  ASSERT_EQ(whole.size(), 4u);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(whole[i].trial, static_cast<std::int64_t>(i));
    EXPECT_EQ(whole[i].scene, whole[i].trial / 2);
    EXPECT_EQ(whole[i].noise_scale, i % 2 == 0 ? 0.0 : 2.0);
    EXPECT_GT(whole[i].fewest_pixels, 0);
    EXPECT_EQ(whole[i].failure, first_failure(whole[i]));
  }
  // An exact image gives the table exactly: depth is in steps of nothing, rays and planes in double precision.
  ASSERT_TRUE(whole[0].table_angle_deg);
  EXPECT_LT(*whole[0].table_angle_deg, 0.01);
  EXPECT_LT(*whole[0].table_offset_mm, 0.1);

  job.partial = directory / "cut.csv";
  job.threads = 2;
  const std::string text = read_file(directory / "whole.csv");
  write_file(job.partial, text.substr(0, text.size() - 30));
  const std::vector<StudyRow> resumed = run_study(ranks, job);
  ASSERT_EQ(resumed.size(), whole.size());
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(without_times(to_csv_line(resumed[i])), without_times(to_csv_line(whole[i])));
  }
  job.partial = directory / "threads.csv";
  const std::vector<StudyRow> threaded = run_study(ranks, job);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(without_times(to_csv_line(threaded[i])), without_times(to_csv_line(whole[i])));
  }
}

TEST(Study, SeriesShareScenesAndReferences) {
  if (!std::filesystem::exists(test_model())) GTEST_SKIP() << "no model at " << test_model();
  const TemporaryDirectory directory;
  Ranks ranks;
  StudyJob job;
  job.config.series[0].model = test_model();
  job.config.series.push_back(job.config.series[0]);
  job.config.series[1].known = false;
  job.config.noise_scales = {1.0};
  job.config.samples = 2;
  job.config.steps = 10;
  job.trials = 4;
  job.seed = 6;
  job.threads = 2;
  job.partial = directory / "series.csv";
  const std::vector<StudyRow> rows = run_study(ranks, job);
  ASSERT_EQ(rows.size(), 4u);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].scene, static_cast<std::int64_t>(i / 2));
    EXPECT_EQ(rows[i].series, static_cast<int>(i % 2));
    EXPECT_EQ(rows[i].known, i % 2 == 0);
    EXPECT_EQ(rows[i].context, rows[i / 2 * 2].context);
    EXPECT_EQ(rows[i].displacement_ground_truth_pct, rows[i / 2 * 2].displacement_ground_truth_pct);
    EXPECT_EQ(rows[i].fewest_pixels, rows[i / 2 * 2].fewest_pixels);  // from the same place
  }
  const std::string page = cases_html(job, {rows[1]});
  EXPECT_THAT(page, AllOf(HasSubstr("Trial 1: unknown objects"), HasSubstr("The true scene, placed so")));
}

// What is wished on top of a cube is put there, in truth as in what was recovered.
TEST(Study, WhatIsWishedOnTopIsPutThere) {
  if (!std::filesystem::exists(test_model())) GTEST_SKIP() << "no model at " << test_model();
  StudyConfig config = study_config_from_json(
      R"({"tasks": [{"task": "stack", "objects": 2, "on_top": true}], "noise_scales": [0], "samples": 16})",
      "study.json");
  config.series[0].model = test_model();
  const StudyModels models(config);
  StudyRunner runner(config, 8, models, load_block_library());
  StudyScene scene = runner.make_scene(0);
  ASSERT_TRUE(scene.on);
  const auto height = [&](std::size_t i) { return scene.truth.T_world_object[i].translation().z(); };
  EXPECT_GT(height(*scene.on), height(1 - *scene.on));
  scene.truth = {{make_block("cube")}, {make_pose(Eigen::Matrix3d::Identity(), {0, 0, 0.025})}};
  scene.query = make_block("cube");
  scene.on = 0;
  const StudyTrial trial = runner.run(scene, 0, runner.reference_row(scene));
  EXPECT_TRUE(trial.row.on_top);
  EXPECT_TRUE(trial.row.stable_ground_truth);
  ASSERT_TRUE(trial.best);
  EXPECT_EQ(trial.best->touches, std::vector<int>{0});
  EXPECT_EQ(trial.row.stable_true, true);
}

// More views see better; where the robot is wrong about its camera, its placement is off by as much.
TEST(Study, ViewsAndWrongCameraPosesCount) {
  if (!std::filesystem::exists(test_model())) GTEST_SKIP() << "no model at " << test_model();
  StudyConfig config;
  config.series[0].model = test_model();
  config.series.push_back(config.series[0]);
  config.series[1].views = 3;
  config.series.push_back(config.series[0]);
  config.series[2].pose_error_mm = 20.0;
  config.noise_scales = {1.0};
  config.samples = 2;
  config.steps = 10;
  const StudyModels models(config);
  StudyRunner runner(config, 8, models, load_block_library());
  const StudyScene scene = runner.make_scene(0);
  const StudyRow reference = runner.reference_row(scene);
  const StudyTrial one = runner.run(scene, 0, reference), three = runner.run(scene, 1, reference),
                   wrong = runner.run(scene, 2, reference);
  ASSERT_EQ(one.views.size(), 1u);
  ASSERT_EQ(three.views.size(), 3u);
  EXPECT_TRUE(three.views[0].T_world_camera.isApprox(one.views[0].T_world_camera));
  EXPECT_GT((three.views[1].T_world_camera.translation() - three.views[0].T_world_camera.translation()).norm(), 0.05);
  EXPECT_EQ(three.row.views, 3);
  ASSERT_TRUE(three.best);
  EXPECT_EQ(three.row.objects_found, three.row.objects_true);

  EXPECT_EQ(wrong.row.pose_error_mm, 20.0);
  ASSERT_TRUE(wrong.row.table_offset_mm && one.row.table_offset_mm && wrong.row.position_error_max_mm);
  EXPECT_LT(*one.row.position_error_max_mm, 2.0);
  EXPECT_GT(*wrong.row.position_error_max_mm, 5.0);
}

}  // namespace
}  // namespace dofusion
