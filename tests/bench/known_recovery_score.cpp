// Scores recover_known() on fresh synthetic scans of the seven blocks: which share of the objects gets the right
// shape, how exact the poses are, and whether placements made on the recovered scene stand in the true one.
//
//   known_recovery_score --count 200 --seed 1 [--threads T] [--noise-scale X] [--list] [--only I --picture FILE.png]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <map>
#include <string>
#include <tuple>

#include <CLI/CLI.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "perception/known_recovery.h"
#include "stability/mesh_symmetry.h"
#include "perception/segmentation.h"
#include "perception/synthetic_view.h"
#include "perception/table.h"
#include "stability/generation.h"
#include "stability/metrics.h"
#include "stability/sdf.h"

namespace {

using namespace dofusion;

struct ScoreOptions {
  int count = 60;
  std::uint64_t seed = 1;
  int threads = 1;
  double noise_scale = 1.0;
  bool list = false;
  int only = -1;
  std::string picture;
};

struct Trial {
  Task task = Task::kSingle;
  Scene truth;
  SyntheticView view;
  std::vector<RecoveredObject> recovered;  // poses in the true world
  LabelImage labels;
  double milliseconds = 0.0;  // of processor time
};

struct ObjectError {
  bool matched = false, right_shape = false;
  int pixels = 0;          // that the object shows
  double translation = 0;  // metres, the shape's symmetries considered
  double angle = 0;        // radians
  double surface = 0;      // metres, mean distance of the recovered mesh's corners to the true surface
};

Trial make_trial(const ScoreOptions& options, int index) {
  static const Task kTasks[] = {Task::kSingle, Task::kUnstructured, Task::kStack};
  Trial trial;
  trial.task = kTasks[index % 3];
  GenerationOptions generation;
  generation.task = trial.task;
  generation.objects = trial.task == Task::kSingle ? 1 : 2;
  generation.seed = options.seed;
  SceneGenerator generator(generation);
  SceneDataset dataset;
  dataset.shapes = generator.shapes();
  trial.truth = to_scene(dataset, generator.generate(index));
  Rng rng = make_rng(options.seed, 1000000 + index);
  SyntheticViewOptions viewing;
  viewing.noise_scale = options.noise_scale;
  trial.view = make_synthetic_view(trial.truth, default_camera(), viewing, rng);
  return trial;
}

void recover(const ScoreOptions& options, Trial& trial) {
  const Camera camera = default_camera();
  const auto table = find_table(trial.view.depth, camera);
  if (!table) return;
  trial.labels = segment(trial.view.depth, camera, *table);
  KnownRecoveryOptions recovery;
  recovery.threads = options.threads;
  const std::clock_t start = std::clock();
  trial.recovered = recover_known(trial.view.depth, camera, *table, trial.labels, all_blocks(), recovery);
  trial.milliseconds = 1000.0 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  for (RecoveredObject& object : trial.recovered) {
    object.T_world_object = trial.view.T_world_camera * table->T_world_camera.inverse() * object.T_world_object;
  }
}

ObjectError compare(const Object& truth, const Pose& T_true, const RecoveredObject& recovered) {
  ObjectError error;
  error.matched = true;
  error.right_shape = recovered.name == truth.name;
  error.translation = (T_true.translation() - recovered.T_world_object.translation()).norm();
  error.angle = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& symmetry : rotation_symmetries(truth.mesh)) {
    error.angle = std::min(error.angle,
                           rotation_angle(T_true.linear().transpose() * recovered.T_world_object.linear() * symmetry));
  }
  const MeshDistance distance(truth.mesh);
  for (const Eigen::Vector3d& vertex : recovered.object->mesh.vertices) {
    error.surface += std::abs(distance(T_true.inverse() * recovered.T_world_object * vertex)) /
                     static_cast<double>(recovered.object->mesh.vertices.size());
  }
  return error;
}

// Each true object's error; recovered objects go to the nearest true ones, one to one.
std::vector<ObjectError> errors_of(const Trial& trial) {
  std::vector<ObjectError> errors(trial.truth.objects.size());
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    for (std::size_t j = 0; j < trial.recovered.size(); ++j) {
      pairs.emplace_back(
          (trial.truth.T_world_object[i].translation() - trial.recovered[j].T_world_object.translation()).norm(), i, j);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<bool> used(trial.recovered.size(), false);
  for (const auto& [distance, i, j] : pairs) {
    if (errors[i].matched || used[j] || distance > 0.05) continue;
    errors[i] = compare(*trial.truth.objects[i], trial.truth.T_world_object[i], trial.recovered[j]);
    used[j] = true;
  }
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const auto& labels = trial.view.truth.labels.pixels;
    errors[i].pixels = static_cast<int>(std::count(labels.begin(), labels.end(), kLabelFirstObject + i));
  }
  return errors;
}

// Drops a random block on the recovered scene, and puts it where it came to rest into the true one: 1 if all stands
// there, 0 if not, -1 if the block stood nowhere on the recovered scene.
int placement_transfers(const ScoreOptions& options, const Trial& trial, int index) {
  Rng rng = make_rng(options.seed, 2000000 + index);
  const std::vector<ObjectPtr> blocks = all_blocks();
  const ObjectPtr query = blocks[uniform_int(rng, 0, static_cast<int>(blocks.size()) - 1)];
  Scene recovered;
  for (const RecoveredObject& object : trial.recovered) {
    recovered.objects.push_back(object.object);
    recovered.T_world_object.push_back(object.T_world_object);
  }
  if (recovered.objects.empty()) return 0;
  for (int attempt = 0; attempt < 20; ++attempt) {
    Scene with_query = recovered;
    with_query.T_world_object.push_back(random_placement(recovered, *query, Task::kUnstructured, rng));
    with_query.objects.push_back(query);
    const SettleResult dropped = Simulator(with_query.objects).settle(with_query.T_world_object);
    if (dropped.status != SettleStatus::kSettled) continue;
    std::vector<Pose> context_after(dropped.T_world_object.begin(), dropped.T_world_object.end() - 1);
    if (!is_stable(displacement(recovered.objects, recovered.T_world_object, context_after))) continue;
    const int query_index = static_cast<int>(recovered.objects.size());
    const bool on_object = std::any_of(dropped.touching.begin(), dropped.touching.end(),
                                       [&](const auto& pair) { return pair.first >= 0 && pair.second == query_index; });
    if (!on_object) continue;
    Scene truth = trial.truth;
    truth.objects.push_back(query);
    truth.T_world_object.push_back(dropped.T_world_object.back());
    const SettleResult settled = Simulator(truth.objects).settle(truth.T_world_object);
    return settled.status == SettleStatus::kSettled &&
           is_stable(displacement(truth.objects, truth.T_world_object, settled.T_world_object));
  }
  return -1;
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

struct Summary {
  int scans = 0, objects = 0, right = 0, count_errors = 0, transfers = 0, transferred = 0;
  std::vector<double> translation_mm, angle_deg, surface_mm, milliseconds;

  void add(const Trial& trial, const std::vector<ObjectError>& errors, int transfer) {
    ++scans;
    milliseconds.push_back(trial.milliseconds);
    count_errors += trial.recovered.size() != errors.size();
    transfers += transfer >= 0;
    transferred += transfer == 1;
    for (const ObjectError& error : errors) {
      ++objects;
      right += error.right_shape;
      if (error.matched) surface_mm.push_back(1000.0 * error.surface);
      if (!error.right_shape) continue;
      translation_mm.push_back(1000.0 * error.translation);
      angle_deg.push_back(error.angle * 180.0 / M_PI);
    }
  }

  void print(const std::string& name) const {
    std::printf(
        "%-13s %4d scans %4d objects | shape right %5.1f %% | wrong count %2d | right shapes: translation "
        "%.2f mm (p90 %.2f), rotation %.2f deg (p90 %.2f) | surface %.2f mm (p90 %.2f) | placement stands "
        "%5.1f %% of %d | processor time %.0f ms (p90 %.0f)\n",
        name.c_str(), scans, objects, 100.0 * right / objects, count_errors, percentile(translation_mm, 0.5),
        percentile(translation_mm, 0.9), percentile(angle_deg, 0.5), percentile(angle_deg, 0.9),
        percentile(surface_mm, 0.5), percentile(surface_mm, 0.9), 100.0 * transferred / std::max(1, transfers),
        transfers, percentile(milliseconds, 0.5), percentile(milliseconds, 0.9));
  }
};

void print_objects(int index, const Trial& trial, const std::vector<ObjectError>& errors, int transfer) {
  for (std::size_t i = 0; i < errors.size(); ++i) {
    std::printf("%4d %-12s %-16s %5d px  ", index, to_string(trial.task).c_str(), trial.truth.objects[i]->name.c_str(),
                errors[i].pixels);
    if (!errors[i].matched) {
      std::printf("MISSED\n");
      continue;
    }
    std::printf("%s %.2f mm %.2f deg surface %.2f mm  transfer %d\n", errors[i].right_shape ? "right" : "WRONG",
                1000.0 * errors[i].translation, errors[i].angle * 180.0 / M_PI, 1000.0 * errors[i].surface, transfer);
  }
  for (const RecoveredObject& object : trial.recovered) {
    std::printf("       found %-16s label %d, %d px, score %.3f\n", object.name.c_str(), object.label, object.pixels,
                object.score);
  }
}

// Left: normals of the truth; middle: labels; right: what was recovered, shaded alike. Twice enlarged.
void write_picture(const Trial& trial, const std::string& path) {
  const Camera camera = default_camera();
  std::vector<ObjectPtr> objects;
  std::vector<Pose> poses;
  for (const RecoveredObject& object : trial.recovered) {
    objects.push_back(object.object);
    poses.push_back(object.T_world_object);
  }
  Scanner scanner(objects);
  scanner.set_poses(poses);
  const Scan found = scanner.render(camera, trial.view.T_world_camera);
  const auto shade = [](const Eigen::Vector3f& n) {
    return cv::Vec3b(cv::saturate_cast<uchar>(127 + 120 * n.x()), cv::saturate_cast<uchar>(127 + 120 * n.y()),
                     cv::saturate_cast<uchar>(127 - 120 * n.z()));
  };
  cv::Mat picture(240, 960, CV_8UC3);
  for (int v = 0; v < 240; ++v) {
    for (int u = 0; u < 320; ++u) {
      picture.at<cv::Vec3b>(v, u) = shade(trial.view.truth.normals.at(v + 120, u + 160));
      const int label = trial.labels.at(v + 120, u + 160);
      picture.at<cv::Vec3b>(v, u + 320) = trial.view.depth.at(v + 120, u + 160) <= 0.0f
                                              ? cv::Vec3b(0, 0, 0)
                                              : cv::Vec3b(static_cast<uchar>(60 * label), static_cast<uchar>(100),
                                                          static_cast<uchar>(255 - 50 * label));
      picture.at<cv::Vec3b>(v, u + 640) = shade(found.normals.at(v + 120, u + 160));
    }
  }
  cv::resize(picture, picture, {}, 2.0, 2.0, cv::INTER_NEAREST);
  cv::imwrite(path, picture);
}

}  // namespace

int main(int argc, char** argv) {
  ScoreOptions options;
  CLI::App app("Scores the recovery of known blocks on synthetic scans");
  app.add_option("--count", options.count, "scans: single, unstructured pair, stacked pair in turn");
  app.add_option("--seed", options.seed, "of scenes, viewpoints and noise");
  app.add_option("--threads", options.threads, "of the recovery");
  app.add_option("--noise-scale", options.noise_scale, "of the RealSense model");
  app.add_flag("--list", options.list, "print every object");
  app.add_option("--only", options.only, "one scan alone");
  app.add_option("--picture", options.picture, "PNG of truth, labels, recovered scene; %d becomes the scan's number");
  CLI11_PARSE(app, argc, argv);
  std::map<std::string, Summary> summaries;
  for (int i = 0; i < options.count; ++i) {
    if (options.only >= 0 && i != options.only) continue;
    Trial trial = make_trial(options, i);
    recover(options, trial);
    const std::vector<ObjectError> errors = errors_of(trial);
    const int transfer = placement_transfers(options, trial, i);
    const bool failed = trial.recovered.size() != errors.size() ||
                        std::any_of(errors.begin(), errors.end(), [](const auto& e) { return !e.right_shape; });
    if (options.list || failed) print_objects(i, trial, errors, transfer);
    if (!options.picture.empty() && (failed || options.only >= 0)) {
      char path[512];
      std::snprintf(path, sizeof(path), options.picture.c_str(), i);
      write_picture(trial, path);
    }
    summaries[to_string(trial.task)].add(trial, errors, transfer);
    summaries["all"].add(trial, errors, transfer);
  }
  for (const auto& [name, summary] : summaries) summary.print(name);
  return 0;
}
