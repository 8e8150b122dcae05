// Scores table, segmentation and model-free recovery on real frames with labels, or on synthetic scans.
//
//   segmentation_score --real DIR --first 0 --last 24      DIR holds camera.json, learn<N>_depth.png,
//   learn<N>_label.png segmentation_score --synthetic 100 --objects 2 --task unstructured --sensor realsense --seed 1

#include <chrono>
#include <cstdio>
#include <exception>
#include <map>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "perception/convex_body.h"
#include "perception/depth_io.h"
#include "perception/overlap_score.h"
#include "perception/plausibility.h"
#include "perception/synthetic_view.h"
#include "perception/unknown_recovery.h"
#include "stability/generation.h"

namespace {

using namespace dofusion;

struct Settings {
  std::string real, task = "unstructured", sensor = "realsense", shapes = "blocks";
  int first = 0, last = 24;
  int synthetic = 0, objects = 2;
  double noise_scale = 1.0, distance = 0.7;
  std::uint64_t seed = 0;
  bool true_labels = false;
};

struct Row {
  OverlapScore score;
  PlausibleScene plausible;
  std::vector<double> volume_iou;  // of true objects with a recovered one, synthetic scans alone
  double milliseconds = 0.0;       // table, segmentation and recovery
};

struct Frame {
  DepthImage depth;
  LabelImage truth;
  Scene scene;  // the true one, in `T_world_camera`'s world; empty for real frames
  Pose T_world_camera = Pose::Identity();
};

std::vector<HalfSpace> placed(const Object& object, const Pose& T_world_object) {
  TriangleMesh mesh = object.mesh;
  for (Eigen::Vector3d& v : mesh.vertices) v = T_world_object * v;
  return half_spaces(mesh);
}

// Monte Carlo over a cube around the true object.
double volume_iou(const Object& a, const Pose& T_a, const Object& b, const Pose& T_b, Rng& rng) {
  const std::vector<HalfSpace> first = placed(a, T_a), second = placed(b, T_b);
  int both = 0, either = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d offset(uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0));
    const Eigen::Vector3d p = T_a.translation() + a.diameter * offset;
    const bool in_a = plane_distance(first, p) < 0.0, in_b = plane_distance(second, p) < 0.0;
    both += in_a && in_b;
    either += in_a || in_b;
  }
  return either > 0 ? static_cast<double>(both) / either : 0.0;
}

// The true object that most pixels of a label show, -1 if none.
int true_object(const LabelImage& found, int label, const LabelImage& truth) {
  std::map<int, int> votes;
  for (std::size_t p = 0; p < found.pixels.size(); ++p) {
    if (found.pixels[p] == label && truth.pixels[p] >= kLabelFirstObject) ++votes[truth.pixels[p] - kLabelFirstObject];
  }
  int best = -1, most = 0;
  for (const auto& [object, count] : votes) {
    if (count > most) most = count, best = object;
  }
  return best;
}

Row score_frame(const Frame& frame, const Camera& camera, const Settings& settings) {
  Row row;
  const auto start = std::chrono::steady_clock::now();
  const std::optional<Table> table = find_table(frame.depth, camera);
  if (!table) {
    row.score.true_objects = count_objects(frame.truth);
    return row;
  }
  const LabelImage found = settings.true_labels ? frame.truth : segment(frame.depth, camera, *table);
  const std::vector<RecoveredObject> objects = recover_unknown(frame.depth, camera, *table, found);
  row.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  row.score = score_segmentation(found, frame.truth);
  row.plausible = make_plausible(to_scene(objects));
  Rng rng = make_rng(settings.seed, 77);
  const Pose T_true_found = frame.T_world_camera * table->T_world_camera.inverse();
  for (const RecoveredObject& object : objects) {
    const int match = frame.scene.objects.empty() ? -1 : true_object(found, object.label, frame.truth);
    if (match < 0) continue;
    row.volume_iou.push_back(volume_iou(*frame.scene.objects[match], frame.scene.T_world_object[match], *object.object,
                                        T_true_found * object.T_world_object, rng));
  }
  return row;
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

void report(const std::vector<Row>& rows) {
  std::vector<double> overlap, boundary, iou, milliseconds;
  int right = 0, still = 0;
  for (const Row& row : rows) {
    overlap.push_back(row.score.overlap_f);
    boundary.push_back(row.score.boundary_f);
    milliseconds.push_back(row.milliseconds);
    iou.insert(iou.end(), row.volume_iou.begin(), row.volume_iou.end());
    right += row.score.found == row.score.true_objects;
    still += row.plausible.status == SettleStatus::kSettled && row.plausible.moved_pct < 5.0 &&
             row.plausible.moved_deg < 5.0;
  }
  std::printf(
      "%zu frames: number of objects right in %d, overlap F %.4f, boundary F %.4f, moved < 5 %% and 5 deg in %d, "
      "%.0f ms a frame\n",
      rows.size(), right, mean(overlap), mean(boundary), still, mean(milliseconds));
  if (!iou.empty()) {
    std::printf("volume IoU of %zu recovered objects: mean %.3f, median %.3f\n", iou.size(), mean(iou), median(iou));
  }
}

void print_row(int index, const Row& row) {
  std::printf("%4d  objects %d/%d  overlap F %.3f  boundary F %.3f  moved %.2f %% %.2f deg %s", index, row.score.found,
              row.score.true_objects, row.score.overlap_f, row.score.boundary_f, row.plausible.moved_pct,
              row.plausible.moved_deg, to_string(row.plausible.status).c_str());
  for (const double iou : row.volume_iou) std::printf("  IoU %.2f", iou);
  std::printf("  %.0f ms\n", row.milliseconds);
}

void score_real(const Settings& settings) {
  const Camera camera = read_camera(settings.real + "/camera.json");
  std::vector<Row> rows;
  for (int n = settings.first; n <= settings.last; ++n) {
    const std::string stem = settings.real + "/learn" + std::to_string(n);
    Frame frame;
    frame.depth = read_depth(stem + "_depth.png", camera);
    frame.truth = read_labels(stem + "_label.png", camera);
    rows.push_back(score_frame(frame, camera, settings));
    print_row(n, rows.back());
  }
  report(rows);
}

void score_synthetic(const Settings& settings) {
  GenerationOptions generation;
  generation.task = task_from_string(settings.task);
  generation.objects = settings.objects;
  generation.shapes = shape_family_from_string(settings.shapes);
  generation.seed = settings.seed;
  SceneGenerator generator(generation);
  const Camera camera = default_camera();
  SyntheticViewOptions options;
  options.sensor = sensor_from_string(settings.sensor);
  options.noise_scale = settings.noise_scale;
  options.viewpoint.distance = settings.distance;
  std::vector<Row> rows;
  for (int i = 0; i < settings.synthetic; ++i) {
    SceneDataset dataset;
    dataset.shapes = generator.shapes();
    Frame frame;
    frame.scene = to_scene(dataset, generator.generate(i));
    Rng rng = make_rng(settings.seed, 1000000 + static_cast<std::uint64_t>(i));
    SyntheticView view = make_synthetic_view(frame.scene, camera, options, rng);
    frame.depth = std::move(view.depth);
    frame.truth = std::move(view.truth.labels);
    frame.T_world_camera = view.T_world_camera;
    rows.push_back(score_frame(frame, camera, settings));
    print_row(i, rows.back());
  }
  report(rows);
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  CLI::App app("Scores table, segmentation and model-free recovery.");
  app.add_option("--real", settings.real, "folder of real frames with labels");
  app.add_option("--first", settings.first, "first real frame");
  app.add_option("--last", settings.last, "last real frame");
  app.add_option("--synthetic", settings.synthetic, "number of synthetic scans");
  app.add_option("--objects", settings.objects, "objects in a synthetic scene");
  app.add_option("--task", settings.task, "single, unstructured or stack");
  app.add_option("--shapes", settings.shapes, "blocks or general");
  app.add_option("--sensor", settings.sensor, "none, kinect, kinect2, realsense or azure");
  app.add_option("--noise-scale", settings.noise_scale, "times the sensor's noise");
  app.add_option("--distance", settings.distance, "metres from camera to scene");
  app.add_option("--seed", settings.seed, "of scenes, views and noise");
  app.add_flag("--true-labels", settings.true_labels, "recover from the true segmentation");
  CLI11_PARSE(app, argc, argv);
  try {
    if (!settings.real.empty()) score_real(settings);
    if (settings.synthetic > 0) score_synthetic(settings);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "segmentation_score: %s\n", error.what());
    return 1;
  }
  return 0;
}
