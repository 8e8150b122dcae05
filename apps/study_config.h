// What dofusion-study varies and keeps fixed; a JSON file in which every field is optional.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "perception/sensor_noise.h"
#include "stability/dataset.h"

namespace dofusion {

// How many blocks stand on the table, and how they came there; the query is one block more.
struct StudyTask {
  Task task = Task::kSingle;
  int objects = 1;
  bool on_top = false;  // the query is wished on the object that reaches highest, and off the table
};

// How the scenes are looked at, and what is known of them.
struct StudyCondition {
  SensorModel sensor = SensorModel::kRealsense;
  double distance_m = 0.7;  // from each camera to the scene's centre
  int views = 1;            // cameras, each from a direction of its own; the first ones are the same for any number
  double pose_error_deg = 0.0, pose_error_mm = 0.0;  // of each camera's pose (miscalibration.h), times the noise scale
  bool known = true;  // the objects are among the shipped blocks; false: nothing is known of them
  std::string model;  // of the placements, file; empty: the shipped one
};

struct StudyConfig {
  std::vector<StudyCondition> series = {{}};                // every scene is tried under each, at each noise scale
  std::vector<double> noise_scales = {0.0, 1.0, 2.0, 4.0};  // of the sensor as published, ascending
  std::vector<StudyTask> tasks = {{Task::kSingle, 1}, {Task::kUnstructured, 2}};  // scene i has task i mod size
  int samples = 8;                                                                // candidates of a placement
  int steps = 50;                                                                 // of the sampler

  const StudyCondition& base() const { return series.front(); }
  std::int64_t trials_per_scene() const { return static_cast<std::int64_t>(series.size() * noise_scales.size()); }
};

// Reads the file. Its fields sensor, distance_m, views, pose_error (degrees and millimetres), known and model are the
// first series; each entry of its list `series` is a further one, which names what differs from the first. A relative
// `model` is relative to the file's folder. Throws InputError naming the file and the field that is unknown or wrong.
StudyConfig read_study_config(const std::string& path);

// As read_study_config; errors begin with `source`, and `model` is taken as it is.
StudyConfig study_config_from_json(const std::string& text, const std::string& source);

// All fields but the models, whose paths say little: see study_settings for what identifies a study.
nlohmann::ordered_json to_json(const StudyConfig& config);

// Depth noise of a surface seen head-on at the condition's distance, standard deviation in mm; 0 for an exact sensor.
double depth_sigma_mm(const StudyCondition& condition, double noise_scale);

// What sets a series apart from the first, for people: "unknown objects, at 1 m"; of the first itself, all of it.
std::string series_title(const StudyConfig& config, std::size_t series);

std::string task_title(const StudyTask& task);  // "one block", "2 stacked blocks, one more wished on top"
std::string sensor_title(SensorModel sensor);   // "the RealSense D435"

}  // namespace dofusion
