// The rows of a study's trials.csv, and the file in which a running study keeps them.
#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace dofusion {

// One trial. A value is missing (an empty cell) where there is nothing to say: no table was found, so nothing was
// recovered or placed; a simulation that diverged has no displacement.
struct StudyRow {
  std::int64_t trial = 0;
  std::int64_t scene = 0;  // trials of one scene share blocks, viewing direction, query and seeds
  int series = 0;          // of the configuration: the condition under which it was looked at
  double noise_scale = 0.0;
  std::string sensor;
  double distance_m = 0.0;
  int views = 1;
  double pose_error_deg = 0.0, pose_error_mm = 0.0;  // standard deviations at noise scale 1
  bool known = false;
  std::string task;
  std::string context;  // the blocks on the table, "cube+hat"
  std::string query;    // the block to place
  bool on_top = false;  // wished on the object that reaches highest, and off the table
  int objects_true = 0;
  std::int64_t fewest_pixels = 0;  // that an object of the true scene shows to the first camera
  std::optional<int> objects_found;
  std::optional<int> shapes_right;  // of the matched objects; known objects only
  // Recovered objects are matched with the nearest true ones, in the robot's frame: where the cameras are believed to
  // be.
  std::optional<double> position_error_mean_mm, position_error_max_mm;  // between centres of mass
  // The worst matched object's error, of its diameter. Same shape: the largest distance from a corner to the nearest
  // corner of the other, so that symmetric poses count as the same; other shapes and unknown objects: between centres.
  std::optional<double> pose_error_max_pct;
  std::optional<double> table_angle_deg;  // between true and recovered table
  std::optional<double> table_offset_mm;  // between them, along the normal, where the optical axis meets the table
  std::optional<int> candidates_stable;   // in the recovered scene, and as wished
  // The best-ranked placement, settled: in the recovered scene, and at the same pose in the robot's frame in the true
  // one.
  std::optional<double> displacement_recovered_pct, displacement_recovered_deg;
  std::optional<bool> stable_recovered;
  std::optional<double> displacement_true_pct, displacement_true_deg;
  std::optional<bool> stable_true;
  // The two references, the same in all trials of a scene, by the first series' model: placed on the true scene with
  // the same seed, and at random.
  std::optional<double> displacement_ground_truth_pct, displacement_ground_truth_deg;
  bool stable_ground_truth = false;
  std::optional<double> displacement_random_pct, displacement_random_deg;
  bool stable_random = false;
  std::string failure;  // see first_failure
  double ms_recover = 0.0;
  std::optional<double> ms_place;
};

// What went wrong first in a trial whose placement does not stand in the true scene; "" if it stands there.
//   table         no table was found
//   segmentation  another number of objects was recovered than there is
//   shape         a known object was taken for another
//   pose          an object is off by more than kPoseErrorPct of its diameter
//   placement     none of these: the scene was recovered well and still nothing stands, or nothing was as wished
std::string first_failure(const StudyRow& row);
inline constexpr double kPoseErrorPct = 5.0;      // half of what a stable object may move
const std::vector<std::string>& failure_names();  // in the order above

// CSV with six significant digits; booleans are 0 and 1. Lines end in "\n".
std::string csv_header();
std::string to_csv_line(const StudyRow& row);
std::optional<StudyRow> row_from_csv_line(const std::string& line);  // without the "\n"; none if it is no row

// The finished rows of a running study in a file: a line "# settings", the header, rows in the order in which they were
// finished. A line that a kill cut short is dropped.
class PartialRows {
 public:
  // Goes on with `path` if it is there, else begins it. Throws InputError naming the file if it cannot be written, is
  // damaged or was made with other settings (one line of text).
  PartialRows(const std::string& path, const std::string& settings);

  // Appends the row and flushes. May be called from several threads.
  void add(const StudyRow& row);

  bool has(std::int64_t trial) const;
  std::int64_t count(std::int64_t trials) const;          // rows of trials below `trials`
  std::vector<StudyRow> rows(std::int64_t trials) const;  // of trials below `trials`, by trial

 private:
  std::string path_;
  mutable std::mutex mutex_;
  std::map<std::int64_t, StudyRow> rows_;
  std::ofstream file_;
};

}  // namespace dofusion
