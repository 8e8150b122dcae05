#include "apps/study_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/files.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

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

}  // namespace
}  // namespace dofusion
