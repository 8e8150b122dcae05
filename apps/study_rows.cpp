#include "apps/study_rows.h"

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <type_traits>

#include "stability/files.h"

namespace dofusion {
namespace {

// Calls visit(name, member) for every column in the order of the file.
template <class Row, class Visit>
void for_each_column(Row& row, Visit visit) {
  visit("trial", row.trial);
  visit("scene", row.scene);
  visit("series", row.series);
  visit("noise_scale", row.noise_scale);
  visit("sensor", row.sensor);
  visit("distance_m", row.distance_m);
  visit("views", row.views);
  visit("pose_error_deg", row.pose_error_deg);
  visit("pose_error_mm", row.pose_error_mm);
  visit("known", row.known);
  visit("task", row.task);
  visit("context", row.context);
  visit("query", row.query);
  visit("on_top", row.on_top);
  visit("objects_true", row.objects_true);
  visit("fewest_pixels", row.fewest_pixels);
  visit("objects_found", row.objects_found);
  visit("shapes_right", row.shapes_right);
  visit("position_error_mean_mm", row.position_error_mean_mm);
  visit("position_error_max_mm", row.position_error_max_mm);
  visit("pose_error_max_pct", row.pose_error_max_pct);
  visit("table_angle_deg", row.table_angle_deg);
  visit("table_offset_mm", row.table_offset_mm);
  visit("candidates_stable", row.candidates_stable);
  visit("displacement_recovered_pct", row.displacement_recovered_pct);
  visit("displacement_recovered_deg", row.displacement_recovered_deg);
  visit("stable_recovered", row.stable_recovered);
  visit("displacement_true_pct", row.displacement_true_pct);
  visit("displacement_true_deg", row.displacement_true_deg);
  visit("stable_true", row.stable_true);
  visit("displacement_ground_truth_pct", row.displacement_ground_truth_pct);
  visit("displacement_ground_truth_deg", row.displacement_ground_truth_deg);
  visit("stable_ground_truth", row.stable_ground_truth);
  visit("displacement_random_pct", row.displacement_random_pct);
  visit("displacement_random_deg", row.displacement_random_deg);
  visit("stable_random", row.stable_random);
  visit("failure", row.failure);
  visit("ms_recover", row.ms_recover);
  visit("ms_place", row.ms_place);
}

std::string cell(const std::string& value) { return value; }
std::string cell(bool value) { return value ? "1" : "0"; }
std::string cell(int value) { return std::to_string(value); }
std::string cell(std::int64_t value) { return std::to_string(value); }
std::string cell(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}
template <class T>
std::string cell(const std::optional<T>& value) {
  return value ? cell(*value) : std::string();
}

bool parse(const std::string& text, std::string& value) {
  value = text;
  return true;
}
bool parse(const std::string& text, bool& value) {
  value = text == "1";
  return text == "0" || text == "1";
}
template <class Number>
bool parse(const std::string& text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}
template <class T>
bool parse(const std::string& text, std::optional<T>& value) {
  value.reset();
  return text.empty() || parse(text, value.emplace());
}

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',')
      cells.emplace_back();
    else
      cells.back() += c;
  }
  return cells;
}

std::map<std::int64_t, StudyRow> read_partial(const std::string& path, const std::string& settings) {
  std::istringstream lines(read_file(path));
  std::map<std::int64_t, StudyRow> rows;
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (lines.eof()) break;  // no line end: the writer was killed within this line
    if (number == 1) {
      if (line != "# " + settings) {
        throw InputError(path +
                         ": left by a study with other settings or another model; delete it or choose another --out");
      }
    } else if (number == 2) {
      if (line + "\n" != csv_header())
        throw InputError(path + ": line 2 is not this program's header; delete the file");
    } else {
      const std::optional<StudyRow> row = row_from_csv_line(line);
      if (!row) throw InputError(path + ": line " + std::to_string(number) + " is damaged; delete that line");
      rows.emplace(row->trial, *row);
    }
  }
  return rows;
}

}  // namespace

const std::vector<std::string>& failure_names() {
  static const std::vector<std::string> names = {"table", "segmentation", "shape", "pose", "placement"};
  return names;
}

std::string first_failure(const StudyRow& row) {
  if (row.stable_true.value_or(false)) return "";
  if (!row.table_angle_deg) return "table";
  if (row.objects_found != row.objects_true) return "segmentation";
  if (row.known && row.shapes_right != row.objects_true) return "shape";
  if (row.pose_error_max_pct.value_or(0.0) > kPoseErrorPct) return "pose";
  return "placement";
}

std::string csv_header() {
  std::string header;
  const StudyRow row;
  for_each_column(row,
                  [&](const char* name, const auto&) { header += (header.empty() ? "" : ",") + std::string(name); });
  return header + "\n";
}

std::string to_csv_line(const StudyRow& row) {
  std::string line;
  bool first = true;
  for_each_column(row, [&](const char*, const auto& value) {
    line += (first ? "" : ",") + cell(value);
    first = false;
  });
  return line + "\n";
}

std::optional<StudyRow> row_from_csv_line(const std::string& line) {
  const std::vector<std::string> cells = split(line);
  StudyRow row;
  std::size_t column = 0;
  bool good = true;
  for_each_column(row, [&](const char*, auto& value) {
    good = good && column < cells.size() && parse(cells[column], value);
    ++column;
  });
  if (!good || column != cells.size()) return std::nullopt;
  return row;
}

PartialRows::PartialRows(const std::string& path, const std::string& settings) : path_(path) {
  if (std::filesystem::exists(path)) rows_ = read_partial(path, settings);
  std::string text = "# " + settings + "\n" + csv_header();
  for (const auto& [trial, row] : rows_) text += to_csv_line(row);
  write_file(path, text);
  file_.open(path, std::ios::app | std::ios::binary);
}

void PartialRows::add(const StudyRow& row) {
  // What a later run would read: the same digits, whether the study was interrupted or not.
  const std::string line = to_csv_line(row);
  const std::lock_guard<std::mutex> lock(mutex_);
  rows_.emplace(row.trial, *row_from_csv_line(line.substr(0, line.size() - 1)));
  file_ << line << std::flush;
  if (!file_) throw InputError(path_ + ": cannot be written; is the disk full?");
}

bool PartialRows::has(std::int64_t trial) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return rows_.count(trial) > 0;
}

std::int64_t PartialRows::count(std::int64_t trials) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::distance(rows_.begin(), rows_.lower_bound(trials));
}

std::vector<StudyRow> PartialRows::rows(std::int64_t trials) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<StudyRow> result;
  for (auto it = rows_.begin(); it != rows_.lower_bound(trials); ++it) result.push_back(it->second);
  return result;
}

}  // namespace dofusion
