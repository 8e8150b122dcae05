// Scores recovery: known and unknown objects from one view and from three, time, and real frames with labels.
//
//   recovery_score --seed 1 --known 100 --unknown 60 --frames 15       synthetic scans
//   recovery_score --real DIR --first 0 --last 24                      camera.json, learn<N>_depth.png, …_label.png
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <mutex>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "perception/depth_io.h"
#include "perception/known_recovery.h"
#include "perception/overlap_score.h"
#include "perception/plausibility.h"
#include "perception/unknown_recovery.h"
#include "recovery_trials.h"
#include "stability/metrics.h"
#include "stability/parallel_for.h"

namespace {

using namespace dofusion;

constexpr double kMinVisible = 0.3;  // objects that show less are not counted

struct Settings {
  int known = 0, unknown = 0, frames = 0, views = 3, threads = 2;
  int only = -1;
  std::uint64_t seed = 1;
  bool list = false;
  std::string sensor = "realsense", real;
  double noise_scale = 1.0, distance = 0.7;
  int first = 0, last = 44;
};

TrialOptions trial_options(const Settings& settings, int views) {
  TrialOptions options;
  options.views = views;
  options.seed = settings.seed;
  options.viewing.sensor = sensor_from_string(settings.sensor);
  options.viewing.noise_scale = settings.noise_scale;
  options.viewing.viewpoint.distance = settings.distance;
  return options;
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

// 95 % interval of a share (Wilson 1927), in per cent.
Interval share_interval(int hits, int count) {
  if (count == 0) return {};
  const double z = 1.96, n = count, p = hits / n;
  const double middle = p + z * z / (2.0 * n), half = z * std::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n));
  return {100.0 * (middle - half) / (1.0 + z * z / n), 100.0 * (middle + half) / (1.0 + z * z / n)};
}

void print_share(const char* what, int hits, int count) {
  const Interval interval = share_interval(hits, count);
  std::printf("%s %.1f %% [%.1f, %.1f] of %d", what, 100.0 * hits / std::max(1, count), interval.low, interval.high,
              count);
}

void print_median(const char* what, const std::vector<double>& values, const char* unit) {
  Rng rng = make_rng(0);
  const Interval interval = values.empty() ? Interval{} : bootstrap_median(values, rng);
  std::printf("%s median %.3f %s [%.3f, %.3f]", what, median(values), unit, interval.low, interval.high);
}

// Whether recovered scenes stand as they are and after make_plausible(), and how far that moves them.
struct Standing {
  int scenes = 0, before = 0, after = 0;
  std::vector<double> moved_pct, moved_deg;

  void add(const Scene& scene) {
    if (scene.objects.empty()) return;
    const auto stands = [](const Scene& at) {
      const SettleResult settled = Simulator(at.objects).settle(at.T_world_object);
      return settled.status == SettleStatus::kSettled &&
             is_stable(displacement(at.objects, at.T_world_object, settled.T_world_object));
    };
    const PlausibleScene plausible = make_plausible(scene);
    ++scenes;
    before += stands(scene);
    after += stands(plausible.scene);
    moved_pct.push_back(plausible.moved_pct);
    moved_deg.push_back(plausible.moved_deg);
  }

  void print() const {
    print_share("  scenes that stand as recovered", before, scenes);
    print_share(", made plausible", after, scenes);
    std::printf("; moved by %.2f %% (p90 %.2f) and %.2f deg (p90 %.2f)\n", percentile(moved_pct, 0.5),
                percentile(moved_pct, 0.9), percentile(moved_deg, 0.5), percentile(moved_deg, 0.9));
  }
};

struct Recovered {
  bool found_table = false;
  std::vector<RecoveredObject> objects;  // poses in the true world
  Scene scene;                           // in the table's world
};

Recovered recover(const Trial& trial, int count, bool known, int threads) {
  std::optional<std::vector<View>> views = on_common_table(views_of(trial, count));
  if (!views) return {};
  segment_views(*views);
  KnownRecoveryOptions options;
  options.threads = threads;
  Recovered result{true, known ? recover_known(*views, all_blocks(), options) : recover_unknown(*views), {}};
  result.scene = to_scene(result.objects);
  for (RecoveredObject& object : result.objects) {
    object.T_world_object =
        trial.seen.front().T_world_camera * views->front().T_world_camera.inverse() * object.T_world_object;
  }
  return result;
}

struct KnownScore {
  int objects = 0, right = 0, wrong_counts = 0;
  std::vector<double> mm, deg;  // of the right shapes
  Standing standing;
};

void list_known(int index, int views, const Trial& trial, const std::vector<ObjectError>& errors,
                const Recovered& recovered) {
  for (std::size_t i = 0; i < errors.size(); ++i) {
    std::printf("  scene %d (%s), %d views, %s, %.0f %% visible: %s, %.2f mm, %.2f deg\n", index, trial.kind.c_str(),
                views, trial.truth.objects[i]->name.c_str(), 100.0 * trial.visible_share[i],
                !errors[i].matched ? "missed" : (errors[i].right_shape ? "right" : "WRONG"),
                1000.0 * errors[i].translation, errors[i].angle * 180.0 / M_PI);
  }
  for (const RecoveredObject& object : recovered.objects) {
    std::printf("    found %s, label %d, %d px, score %.3f\n", object.name.c_str(), object.label, object.pixels,
                object.score);
  }
}

void score_known(const Settings& settings, int views) {
  const TrialOptions trials = trial_options(settings, views);
  KnownScore score;
  std::mutex mutex;
  parallel_for(settings.known, settings.threads, [&](std::int64_t i, int) {
    if (settings.only >= 0 && i != settings.only) return;
    const Trial trial = make_trial(trials, static_cast<int>(i));
    const Recovered recovered = recover(trial, views, true, 1);
    const std::vector<ObjectError> errors = known_errors(trial.truth, recovered.objects);
    const std::lock_guard<std::mutex> lock(mutex);
    bool failed = false;
    score.wrong_counts += recovered.objects.size() != errors.size();
    for (std::size_t k = 0; k < errors.size(); ++k) {
      if (trial.visible_share[k] < kMinVisible) continue;
      ++score.objects;
      score.right += errors[k].right_shape;
      failed |= !errors[k].right_shape || errors[k].angle > 0.1;
      if (!errors[k].right_shape) continue;
      score.mm.push_back(1000.0 * errors[k].translation);
      score.deg.push_back(errors[k].angle * 180.0 / M_PI);
    }
    score.standing.add(recovered.scene);
    if (settings.list && failed) list_known(static_cast<int>(i), views, trial, errors, recovered);
  });
  std::printf("known, %d view%s, %d scenes of 1-3 blocks: ", views, views > 1 ? "s" : "", settings.known);
  print_share("right shape", score.right, score.objects);
  std::printf("; wrong number in %d\n  ", score.wrong_counts);
  print_median("translation", score.mm, "mm");
  std::printf(", p90 %.3f; ", percentile(score.mm, 0.9));
  print_median("rotation", score.deg, "deg");
  std::printf(", p90 %.3f\n", percentile(score.deg, 0.9));
  score.standing.print();
}

void score_unknown(const Settings& settings, int views) {
  TrialOptions trials = trial_options(settings, views);
  trials.shapes = TrialShapes::kBlocksAndBoxes;
  std::vector<double> ious;
  int right_counts = 0;
  Standing standing;
  std::mutex mutex;
  parallel_for(settings.unknown, settings.threads, [&](std::int64_t i, int) {
    if (settings.only >= 0 && i != settings.only) return;
    const Trial trial = make_trial(trials, static_cast<int>(i));
    const Recovered recovered = recover(trial, views, false, 1);
    Rng rng = make_rng(settings.seed, 77 + static_cast<std::uint64_t>(i));
    const std::vector<double> own = unknown_ious(trial.truth, recovered.objects, rng);
    const std::lock_guard<std::mutex> lock(mutex);
    right_counts += recovered.objects.size() == trial.truth.objects.size();
    for (std::size_t k = 0; k < own.size(); ++k) {
      if (trial.visible_share[k] < kMinVisible) continue;
      ious.push_back(own[k]);
      if (settings.list && own[k] < 0.6) {
        std::printf("  scene %d (%s), %d views, %s, %.0f %% visible: IoU %.2f, %zu of %zu objects\n",
                    static_cast<int>(i), trial.kind.c_str(), views, trial.truth.objects[k]->name.c_str(),
                    100.0 * trial.visible_share[k], own[k], recovered.objects.size(), own.size());
      }
    }
    standing.add(recovered.scene);
  });
  std::printf("unknown, %d view%s, %d scenes of 1-3 blocks or boxes: ", views, views > 1 ? "s" : "", settings.unknown);
  print_median("volume IoU", ious, "");
  std::printf(", p10 %.3f, of %zu objects; ", percentile(ious, 0.1), ious.size());
  print_share("number right in", right_counts, settings.unknown);
  std::printf("\n");
  standing.print();
}

// Wall time of a frame with three objects: table, segmentation and recovery.
void score_time(const Settings& settings) {
  TrialOptions trials = trial_options(settings, 1);
  trials.objects = 3;
  const Camera camera = default_camera();
  const auto now = [] { return std::chrono::steady_clock::now(); };
  const auto ms = [](auto from, auto to) { return std::chrono::duration<double, std::milli>(to - from).count(); };
  std::vector<double> table_ms, segment_ms, unknown_ms, known_ms;
  for (int i = 0; i < settings.frames; ++i) {
    const Trial trial = make_trial(trials, i);
    const DepthImage& depth = trial.seen.front().depth;
    const auto start = now();
    const std::optional<Table> table = find_table(depth, camera);
    if (!table) continue;
    const auto found_table = now();
    const LabelImage labels = segment(depth, camera, *table);
    const auto segmented = now();
    recover_unknown(depth, camera, *table, labels);
    const auto unknown = now();
    KnownRecoveryOptions options;
    options.threads = settings.threads;
    recover_known(depth, camera, *table, labels, all_blocks(), options);
    const double before = ms(start, segmented);
    known_ms.push_back(before + ms(unknown, now()));
    unknown_ms.push_back(before + ms(segmented, unknown));
    table_ms.push_back(ms(start, found_table));
    segment_ms.push_back(ms(found_table, segmented));
  }
  std::printf(
      "one 640x480 frame of 3 objects, %d threads, %d frames: unknown %.0f ms (p90 %.0f), known %.0f ms (p90 "
      "%.0f); in both table %.0f ms and segmentation %.0f ms\n",
      settings.threads, settings.frames, median(unknown_ms), percentile(unknown_ms, 0.9), median(known_ms),
      percentile(known_ms, 0.9), median(table_ms), median(segment_ms));
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

void score_real(const Settings& settings) {
  const Camera camera = read_camera(settings.real + "/camera.json");
  std::vector<double> overlap, boundary;
  int right = 0;
  Standing standing;
  for (int n = settings.first; n <= settings.last; ++n) {
    const std::string stem = settings.real + "/learn" + std::to_string(n);
    const DepthImage depth = read_depth(stem + "_depth.png", camera);
    const LabelImage truth = read_labels(stem + "_label.png", camera);
    const std::optional<Table> table = find_table(depth, camera);
    const LabelImage found = table ? segment(depth, camera, *table) : LabelImage(depth.width, depth.height);
    const OverlapScore score = score_segmentation(found, truth);
    overlap.push_back(score.overlap_f);
    boundary.push_back(score.boundary_f);
    right += score.found == score.true_objects;
    if (table) standing.add(to_scene(recover_unknown(depth, camera, *table, found)));
    if (!settings.list) continue;
    std::printf("  frame %d: objects %d of %d, overlap F %.3f, boundary F %.3f\n", n, score.found, score.true_objects,
                score.overlap_f, score.boundary_f);
  }
  std::printf("real frames %d-%d: number right in %d of %zu, overlap F %.3f, boundary F %.3f\n", settings.first,
              settings.last, right, overlap.size(), mean(overlap), mean(boundary));
  standing.print();
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  CLI::App app("Scores the recovery of scenes from depth images.");
  app.add_option("--known", settings.known, "scenes of the seven blocks, recovered as known objects");
  app.add_option("--unknown", settings.unknown, "scenes of blocks and of boxes of random size, as unknown ones");
  app.add_option("--frames", settings.frames, "frames of three blocks whose recovery is timed");
  app.add_option("--views", settings.views, "besides one view, recover from so many");
  app.add_option("--seed", settings.seed, "of scenes, views and noise");
  app.add_option("--threads", settings.threads, "scenes at a time; threads of a timed frame");
  app.add_option("--sensor", settings.sensor, "none, kinect, kinect2, realsense or azure");
  app.add_option("--noise-scale", settings.noise_scale, "times the sensor's noise");
  app.add_option("--distance", settings.distance, "metres from camera to scene");
  app.add_option("--real", settings.real, "folder of real frames with labels");
  app.add_option("--first", settings.first, "first real frame");
  app.add_option("--last", settings.last, "last real frame");
  app.add_option("--only", settings.only, "one scene alone");
  app.add_flag("--list", settings.list, "print what went wrong");
  CLI11_PARSE(app, argc, argv);
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);  // a stopped run keeps its lines
  try {
    for (const int views : {1, settings.views}) {
      if (settings.known > 0) score_known(settings, views);
      if (settings.unknown > 0) score_unknown(settings, views);
      if (settings.views <= 1) break;
    }
    if (settings.frames > 0) score_time(settings);
    if (!settings.real.empty()) score_real(settings);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "recovery_score: %s\n", error.what());
    return 1;
  }
  return 0;
}
