// What dofusion-study varies and keeps fixed; a JSON file in which every field is optional.
#pragma once

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
};

struct StudyConfig {
  SensorModel sensor = SensorModel::kRealsense;
  std::vector<double> noise_scales = {0.0, 1.0, 2.0, 4.0};  // of the sensor as published, ascending
  double distance_m = 0.7;                                  // from the camera to the scene's centre
  bool known = true;  // the objects are among the shipped blocks; false: nothing is known of them
  std::vector<StudyTask> tasks = {{Task::kSingle, 1}, {Task::kUnstructured, 2}};  // scene i has task i mod size
  int samples = 8;                                                                // candidates of a placement
  int steps = 50;                                                                 // of the sampler
  std::string model;                                                              // file; empty: the shipped one
};

// Reads the file; a relative `model` is relative to the file's folder. Throws InputError naming the file and the
// field that is unknown or wrong.
StudyConfig read_study_config(const std::string& path);

// As read_study_config; errors begin with `source`, and `model` is taken as it is.
StudyConfig study_config_from_json(const std::string& text, const std::string& source);

// All fields but the model, whose path says little: see PartialRows for what identifies a study.
nlohmann::ordered_json to_json(const StudyConfig& config);

// Depth noise of a surface seen head-on at the study's distance, standard deviation in mm; 0 for an exact sensor.
double depth_sigma_mm(const StudyConfig& config, double noise_scale);

}  // namespace dofusion
