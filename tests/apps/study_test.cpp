#include "apps/study.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "apps/study_cases.h"
#include "apps/study_figures.h"
#include "apps/study_report.h"
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
  add(3, 1.0, {}, "placement");  // nothing was carried out
  add(4, 0.0, 99.0, "shape");
  add(5, 1.0, 0.1, "");
  std::vector<std::int64_t> trials;
  for (const StudyRow& row : worst_cases(rows, 3)) trials.push_back(row.trial);
  EXPECT_EQ(trials, (std::vector<std::int64_t>{5, 0, 3, 4}));
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

  // Scene 0 has the first task, scene 1 the second.
  EXPECT_DOUBLE_EQ(noisy.stable_by_task.at("one block").value, 1.0);
  EXPECT_DOUBLE_EQ(noisy.stable_by_task.at("2 blocks touching or side by side").value, 0.0);
  EXPECT_DOUBLE_EQ(summary.ground_truth_by_task.at("one block").stable.value, 1.0);

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

}  // namespace
}  // namespace dofusion
