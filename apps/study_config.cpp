#include "apps/study_config.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

using nlohmann::json;

// Takes the fields of an object one by one; what is left in the end is unknown.
class Fields {
 public:
  // `prefix` stands before field names in messages: "" or "tasks[1].".
  Fields(json object, std::string source, std::string prefix)
      : object_(std::move(object)), source_(std::move(source)), prefix_(std::move(prefix)) {}

  // Sets `value` if the field is there; `wanted` describes the type, `valid` the range.
  template <class T>
  void take(
      const char* name, T& value, const std::string& wanted,
      const std::function<bool(const T&)>& valid = [](const T&) { return true; }) {
    const auto field = object_.find(name);
    if (field == object_.end()) return;
    if (!is_a<T>(*field)) fail(name, wanted, *field);
    value = field->get<T>();
    if (!valid(value)) fail(name, wanted, *field);
    object_.erase(field);
  }

  // As take, for a field that names one of several things; `parse` throws std::invalid_argument on others.
  template <class T>
  void take_name(const char* name, T& value, T (*parse)(const std::string&)) {
    std::string text;
    take<std::string>(name, text, "a string");
    if (text.empty()) return;
    try {
      value = parse(text);
    } catch (const std::invalid_argument& error) {
      throw InputError(source_ + ": '" + prefix_ + name + "': " + error.what());
    }
  }

  void finish() const {
    if (!object_.empty()) throw InputError(source_ + ": unknown field '" + prefix_ + object_.begin().key() + "'");
  }

  [[noreturn]] void fail(const std::string& name, const std::string& wanted, const json& got) const {
    throw InputError(source_ + ": '" + prefix_ + name + "' must be " + wanted + ", not " + got.dump());
  }

 private:
  template <class T>
  static bool is_a(const json& field) {
    if constexpr (std::is_same_v<T, bool>) return field.is_boolean();
    if constexpr (std::is_same_v<T, int>) return field.is_number_integer();
    if constexpr (std::is_same_v<T, double>) return field.is_number();
    if constexpr (std::is_same_v<T, std::string>)
      return field.is_string() && !field.get_ref<const std::string&>().empty();
    if constexpr (std::is_same_v<T, json>) return true;
    if constexpr (std::is_same_v<T, std::vector<double>>) {
      if (!field.is_array()) return false;
      for (const json& entry : field)
        if (!entry.is_number()) return false;
      return true;
    }
  }

  json object_;
  std::string source_, prefix_;
};

bool are_noise_scales(const std::vector<double>& scales) {
  if (scales.empty()) return false;
  for (std::size_t i = 0; i < scales.size(); ++i) {
    if (!(scales[i] >= 0.0 && scales[i] <= 100.0)) return false;
    if (i > 0 && scales[i] <= scales[i - 1]) return false;
  }
  return true;
}

StudyTask task_from_json(const json& entry, const std::string& source, const std::string& name) {
  if (!entry.is_object()) throw InputError(source + ": '" + name + "' must be an object with task and objects");
  StudyTask task;
  bool has_objects = entry.contains("objects");
  if (!entry.contains("task")) throw InputError(source + ": '" + name + ".task' is missing");
  Fields fields(entry, source, name + ".");
  fields.take_name<Task>("task", task.task, task_from_string);
  task.objects = task.task == Task::kSingle ? 1 : 2;
  const bool single = task.task == Task::kSingle;
  fields.take<int>("objects", task.objects, single ? "1 for single" : "2 to 6 for stack and unstructured",
                   [&](const int& n) { return single ? n == 1 : n >= 2 && n <= 6; });
  fields.take<bool>("on_top", task.on_top, "true or false");
  if (!has_objects && !single) throw InputError(source + ": '" + name + ".objects' is missing");
  fields.finish();
  return task;
}

// Takes what a condition consists of; what is absent stays.
void take_condition(Fields& fields, StudyCondition& condition) {
  fields.take_name<SensorModel>("sensor", condition.sensor, sensor_from_string);
  fields.take<double>("distance_m", condition.distance_m, "a number between 0.1 and 10",
                      [](const double& d) { return d >= 0.1 && d <= 10.0; });
  fields.take<int>("views", condition.views, "a whole number between 1 and 8",
                   [](const int& n) { return n >= 1 && n <= 8; });
  std::vector<double> pose_error = {condition.pose_error_deg, condition.pose_error_mm};
  fields.take<std::vector<double>>(
      "pose_error", pose_error, "[degrees, millimetres], each between 0 and 1000", [](const std::vector<double>& v) {
        return v.size() == 2 && std::min(v[0], v[1]) >= 0.0 && std::max(v[0], v[1]) <= 1000.0;
      });
  condition.pose_error_deg = pose_error[0];
  condition.pose_error_mm = pose_error[1];
  fields.take<bool>("known", condition.known, "true or false");
  fields.take<std::string>("model", condition.model, "a file's path");
}

nlohmann::ordered_json to_json(const StudyCondition& condition) {
  return {{"sensor", to_string(condition.sensor)},
          {"distance_m", condition.distance_m},
          {"views", condition.views},
          {"pose_error", {condition.pose_error_deg, condition.pose_error_mm}},
          {"known", condition.known}};
}

bool is_same(const StudyCondition& a, const StudyCondition& b) {
  return to_json(a) == to_json(b) && a.model == b.model;
}

StudyCondition condition_from_json(const json& entry, const StudyCondition& base, const std::string& source,
                                   const std::string& name) {
  if (!entry.is_object()) throw InputError(source + ": '" + name + "' must be an object of what differs");
  StudyCondition condition = base;
  Fields fields(entry, source, name + ".");
  take_condition(fields, condition);
  fields.finish();
  return condition;
}

void take_series(Fields& fields, std::vector<StudyCondition>& series, const std::string& source) {
  json list = json::array();
  fields.take<json>("series", list, "a list of objects", [](const json& value) { return value.is_array(); });
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string name = "series[" + std::to_string(i) + "]";
    const StudyCondition condition = condition_from_json(list[i], series.front(), source, name);
    for (const StudyCondition& other : series)
      if (is_same(condition, other)) throw InputError(source + ": '" + name + "' is the same as a series before it");
    series.push_back(condition);
  }
}

std::string plain(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

}  // namespace

StudyConfig study_config_from_json(const std::string& text, const std::string& source) {
  json object;
  try {
    object = json::parse(text);
  } catch (const json::exception& error) {
    throw InputError(source + ": is not valid JSON (" + error.what() + ")");
  }
  if (!object.is_object()) throw InputError(source + ": must hold a JSON object of the study's settings");

  StudyConfig config;
  Fields fields(object, source, "");
  take_condition(fields, config.series.front());
  take_series(fields, config.series, source);
  fields.take<std::vector<double>>("noise_scales", config.noise_scales, "a list of ascending numbers between 0 and 100",
                                   are_noise_scales);
  fields.take<int>("samples", config.samples, "a whole number between 1 and 10000",
                   [](const int& n) { return n >= 1 && n <= 10000; });
  fields.take<int>("steps", config.steps, "a whole number between 1 and 10000",
                   [](const int& n) { return n >= 1 && n <= 10000; });
  json tasks;
  fields.take<json>("tasks", tasks, "a list of objects with task and objects",
                    [](const json& list) { return list.is_array() && !list.empty(); });
  fields.finish();
  if (!tasks.is_null()) config.tasks.clear();
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    config.tasks.push_back(task_from_json(tasks[i], source, "tasks[" + std::to_string(i) + "]"));
  }
  return config;
}

StudyConfig read_study_config(const std::string& path) {
  StudyConfig config = study_config_from_json(read_file(path), path);
  for (StudyCondition& condition : config.series)
    if (!condition.model.empty())
      condition.model = (std::filesystem::path(path).parent_path() / condition.model).string();
  return config;
}

nlohmann::ordered_json to_json(const StudyConfig& config) {
  nlohmann::ordered_json tasks = nlohmann::ordered_json::array();
  for (const StudyTask& task : config.tasks) {
    tasks.push_back({{"task", to_string(task.task)}, {"objects", task.objects}, {"on_top", task.on_top}});
  }
  nlohmann::ordered_json series = nlohmann::ordered_json::array();
  for (const StudyCondition& condition : config.series) series.push_back(to_json(condition));
  return {{"series", series},
          {"noise_scales", config.noise_scales},
          {"tasks", tasks},
          {"samples", config.samples},
          {"steps", config.steps}};
}

double depth_sigma_mm(const StudyCondition& condition, double noise_scale) {
  const SensorTerms terms = sensor_terms(condition.sensor);
  return terms.axial_sigma == nullptr ? 0.0 : 1000.0 * noise_scale * terms.axial_sigma(condition.distance_m, 0.0);
}

std::string series_title(const StudyConfig& config, std::size_t series) {
  const StudyCondition &base = config.base(), &own = config.series.at(series);
  std::vector<std::string> parts;
  const bool first = series == 0;
  if (first || own.known != base.known) parts.push_back(own.known ? "known objects" : "unknown objects");
  if (first || own.sensor != base.sensor) parts.push_back(sensor_title(own.sensor));
  if (first || own.distance_m != base.distance_m) parts.push_back("at " + plain(own.distance_m) + " m");
  if (own.views != base.views || (first && own.views > 1))
    parts.push_back(own.views == 1 ? "one view" : std::to_string(own.views) + " views");
  if (own.pose_error_deg != base.pose_error_deg || own.pose_error_mm != base.pose_error_mm ||
      (first && own.pose_error_deg + own.pose_error_mm > 0.0))
    parts.push_back("camera poses off by " + plain(own.pose_error_deg) + "° and " + plain(own.pose_error_mm) + " mm");
  if (!first && own.model != base.model)
    parts.push_back(own.model.empty() ? "the shipped model" : std::filesystem::path(own.model).filename().string());
  std::string title;
  for (const std::string& part : parts) title += (title.empty() ? "" : ", ") + part;
  return title;
}

std::string task_title(const StudyTask& task) {
  std::string title = "one block";
  if (task.task == Task::kStack) title = std::to_string(task.objects) + " stacked blocks";
  if (task.task == Task::kUnstructured) title = std::to_string(task.objects) + " blocks touching or side by side";
  return title + (task.on_top ? ", one more wished on top" : "");
}

std::string sensor_title(SensorModel sensor) {
  switch (sensor) {
    case SensorModel::kNone:
      return "an exact sensor";
    case SensorModel::kKinect:
      return "the first Kinect";
    case SensorModel::kKinect2:
      return "the Kinect v2";
    case SensorModel::kRealsense:
      return "the RealSense D435";
    case SensorModel::kAzure:
      return "the Azure Kinect";
  }
  return "";
}

}  // namespace dofusion
