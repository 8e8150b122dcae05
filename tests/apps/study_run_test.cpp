// Whole trials of the study.
#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/assets.h"
#include "apps/study.h"
#include "apps/study_cases.h"
#include "apps/study_runner.h"
#include "stability/files.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

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
