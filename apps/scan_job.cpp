#include "apps/scan_job.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <functional>
#include <memory>
#include <vector>

#include <sys/resource.h>

#include "apps/program.h"
#include "apps/scan_folder.h"
#include "apps/scan_scenes.h"
#include "perception/bop_dataset.h"
#include "perception/quick_picture.h"
#include "stability/files.h"
#include "stability/parallel_for.h"

namespace dofusion {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::uint64_t kViewSeed = 0x5CA4;  // keeps the draws of viewpoints and noise apart from the scenes'
constexpr char kJournal[] = "scenes.journal";

bool is_new(const ScanJob& job) { return job.data.empty() && job.mjcf.file.empty(); }

ordered_json settings_of(const ScanJob& job, const GenerationOptions& generation, std::int64_t count) {
  ordered_json settings{{"format", "dofusion-scan"}, {"version", 1}};
  if (is_new(job)) settings["generation"] = ordered_json::parse(to_json(generation));
  settings.update(
      ordered_json{{"count", count},
                   {"cameras", job.cameras},
                   {"sensor", to_string(job.view.sensor)},
                   {"noise_scale", job.view.noise_scale},
                   {"pose_error_deg", job.view.miscalibration.rotation_deg},
                   {"pose_error_m", job.view.miscalibration.translation},
                   {"pose_error", {job.view.miscalibration.rotation_deg, job.view.miscalibration.translation}},
                   {"distance", job.view.viewpoint.distance},
                   {"depth_scale", job.camera.depth_scale},
                   {"size", {job.camera.width, job.camera.height}},
                   {"focal_length", {job.camera.fx, job.camera.fy}},
                   {"split", job.split},
                   {"seed", job.seed},
                   {"fine_rgb", job.fine_rgb},
                   {"pcd", job.clouds}});
  return settings;
}

// The scenes are read before the folder is made, so that bad input leaves nothing; new ones are made inside it.
SceneDataset read_scenes(const ScanJob& job) {
  DatasetFilter filter;
  if (!job.data_split.empty()) filter.split = split_from_string(job.data_split);
  if (job.count > 0) filter.most = static_cast<std::size_t>(job.count);
  SceneDataset dataset = read_dataset(job.data, filter);
  if (dataset.scenes.empty()) throw InputError(job.data + ": has no scene to scan");
  return dataset;
}

// Where a scene's folder is while images are missing, and then.
struct SceneFolders {
  fs::path work, finished;
};

SceneFolders folders_of(const ScanFolder& folder, const ScanJob& job, std::int64_t scene) {
  const std::string name = bop_scene_name(static_cast<int>(scene));
  return {folder.path() / job.split / ("." + name + ".partial"), folder.path() / job.split / name};
}

// What a thread keeps of the scene that it is at.
struct SceneAtHand {
  std::int64_t number = -1;
  std::unique_ptr<SceneScanner> scanner;
  std::unique_ptr<BopSceneWriter> writer;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
};

class Scans {
 public:
  Scans(const ScanJob& job, const ScanScenes& scenes, const ScanFolder& folder)
      : job_(job), scenes_(scenes), folder_(folder), hands_(static_cast<std::size_t>(job.threads)) {
    cameras_ = scenes.views.empty() ? job.cameras : static_cast<int>(scenes.views.size());
    for (std::size_t k = 0; k < scenes.scenes.size(); ++k) {
      missing_.push_back(std::make_unique<std::atomic<int>>(0));
      find_missing(static_cast<std::int64_t>(k));
    }
  }

  std::int64_t images() const { return static_cast<std::int64_t>(scenes_.scenes.size()) * cameras_; }
  std::int64_t left() const { return static_cast<std::int64_t>(left_.size()); }

  void make(const std::function<void()>& image_done) {
    parallel_for(left(), job_.threads, [&](std::int64_t k, int thread) {
      if (interrupted()) throw Interrupted("interrupted");
      const auto [scene, image] = left_[static_cast<std::size_t>(k)];
      try {
        scan(scene, image, hands_[static_cast<std::size_t>(thread)]);
      } catch (const UnusableScene& e) {
        throw of_scene(scene, e);
      }
      if (--*missing_[static_cast<std::size_t>(scene)] == 0) finish(scene);
      image_done();
    });
  }

 private:
  struct Item {
    std::int64_t scene;
    int image;
  };

  void find_missing(std::int64_t scene) {
    const SceneFolders folders = folders_of(folder_, job_, scene);
    std::error_code error;
    if (fs::exists(folders.finished, error)) return;
    int missing = 0;
    for (int image = 0; image < cameras_; ++image) {
      if (has_bop_image(folders.work, image)) continue;
      left_.push_back({scene, image});
      ++missing;
    }
    *missing_[static_cast<std::size_t>(scene)] = missing;
    if (missing == 0) finish(scene);  // killed between its last image and its end
  }

  void take_up(std::int64_t number, SceneAtHand& hand) const {
    const auto k = static_cast<std::size_t>(number);
    const Scene& scene = scenes_.scenes[k];
    hand.writer.reset();  // stands on the scanner
    hand.scanner = scenes_.geoms ? make_scene_scanner(*scenes_.geoms) : make_scene_scanner(scene);
    hand.writer = std::make_unique<BopSceneWriter>(scene, *hand.scanner, scenes_.ids[k],
                                                   folders_of(folder_, job_, number).work, job_.clouds);
    hand.centre = scene_centre(scene);
    hand.number = number;
  }

  ScanView view_of(int image, const SceneAtHand& hand, Rng& rng) const {
    if (!scenes_.views.empty()) return scenes_.views[static_cast<std::size_t>(image)];
    return {"", job_.camera, sample_viewpoint(hand.centre, job_.view.viewpoint, rng)};
  }

  void scan(std::int64_t number, int image, SceneAtHand& hand) const {
    if (hand.number != number) take_up(number, hand);
    Rng rng = make_rng(job_.seed ^ kViewSeed, static_cast<std::uint64_t>(number * cameras_ + image));
    const ScanView from = view_of(image, hand, rng);
    const std::string problem = hand.scanner->viewpoint_problem(from.T_world_camera);
    if (!problem.empty()) {
      throw UnusableScene("image " + std::to_string(image) + (from.name.empty() ? "" : " (" + from.name + ")") + ": " +
                          problem + "; choose " +
                          (scenes_.views.empty() ? "another --distance or --seed" : "others with --camera"));
    }
    Shot shot = hand.scanner->shoot(from.camera, from.T_world_camera, job_.fine_rgb);
    const SyntheticView view =
        make_synthetic_view(std::move(shot.scan), from.camera, from.T_world_camera, job_.view, rng);
    hand.writer->add(image, from.camera, view, shot.picture);
  }

  void finish(std::int64_t scene) const {
    const SceneFolders folders = folders_of(folder_, job_, scene);
    try {
      finish_bop_scene(folders.work, cameras_, scenes_.scenes[static_cast<std::size_t>(scene)]);
    } catch (const UnusableScene& e) {
      throw of_scene(scene, e);
    }
    std::error_code error;
    fs::rename(folders.work, folders.finished, error);
    if (error) throw InputError(folders.finished.string() + ": cannot be written (" + error.message() + ")");
  }

  static UnusableScene of_scene(std::int64_t scene, const UnusableScene& error) {
    return UnusableScene("scene " + std::to_string(scene) + ": " + error.what());
  }

  const ScanJob& job_;
  const ScanScenes& scenes_;
  const ScanFolder& folder_;
  int cameras_ = 0;                                         // images a scene
  std::vector<SceneAtHand> hands_;                          // per thread
  std::vector<std::unique_ptr<std::atomic<int>>> missing_;  // images, per scene
  std::vector<Item> left_;
};

double processor_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

void write_models(const ScanScenes& scenes, const ScanJob& job, const ScanFolder& folder) {
  std::error_code error;
  if (fs::exists(folder.path() / "models" / "models_info.json", error)) return;
  write_bop_models(scenes.models, scenes.views.empty() ? job.camera : scenes.views.front().camera, folder.path(),
                   job.threads);
}

// Steps of depth that leave room for what lies behind the objects: 65535 of them is all an image holds.
double depth_step_mm(double distance) {
  constexpr double kFine = 0.1, kRoom = 2.0;
  double step = kFine;
  while (65.535 * step < kRoom * distance) step *= 10.0;
  return step;
}

// The job with what its scenes decide: how far away cameras look from, and in which steps of depth.
ScanJob fitted(ScanJob job, ScanScenes& scenes) {
  if (job.distance == 0.0) {
    job.distance = scenes.geoms ? viewing_distance(scenes.scenes.front(), job.camera) : job.view.viewpoint.distance;
  }
  job.view.viewpoint.distance = job.distance;
  job.camera.depth_scale = depth_step_mm(job.distance);
  for (ScanView& view : scenes.views) {
    const Eigen::Vector3d eye = view.T_world_camera.translation();
    view.camera.depth_scale = depth_step_mm((eye - scene_centre(scenes.scenes.front())).norm());
  }
  return job;
}

ScanResult scan_all(const ScanJob& job, const ScanScenes& scenes, const ScanFolder& folder) {
  write_models(scenes, job, folder);
  Scans scans(job, scenes, folder);
  ScanResult result;
  result.scenes = static_cast<std::int64_t>(scenes.scenes.size());
  result.images = scans.images();
  result.models = static_cast<std::int64_t>(scenes.models.size());
  result.resumed = scans.images() - scans.left();
  if (folder.resumed()) {
    note("continuing with the " + std::to_string(result.resumed) + " images of " + folder.path().string());
  }
  const auto begin = std::chrono::steady_clock::now();
  const double processor_begin = processor_seconds();
  Progress progress("images", result.images, result.resumed);
  std::atomic<std::int64_t> done{result.resumed};
  scans.make([&] { progress.update(++done); });
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const auto made = static_cast<double>(std::max<std::int64_t>(1, scans.left()));
  result.images_per_second = result.seconds > 0.0 ? static_cast<double>(scans.left()) / result.seconds : 0.0;
  result.processor_ms_per_image = 1000.0 * (processor_seconds() - processor_begin) / made;
  return result;
}

}  // namespace

ScanResult scan_scenes(const ScanJob& wanted) {
  GenerationOptions generation = wanted.generation;
  generation.seed = wanted.seed;
  const std::int64_t fresh = wanted.count > 0 ? wanted.count : 10;
  ScanScenes scenes;
  if (!is_new(wanted)) {
    scenes =
        wanted.data.empty() ? scan_scenes_of_mjcf(wanted.mjcf, wanted.camera) : scan_scenes_of(read_scenes(wanted));
  }
  const ScanJob job = fitted(wanted, scenes);
  ordered_json settings = settings_of(job, generation, fresh);
  if (!is_new(job)) {
    settings["count"] = scenes.scenes.size();
    settings["scenes"] = fingerprint(scenes);
  }
  if (is_new(job)) SceneGenerator{generation};  // bad settings throw before there is a folder
  ScanFolder folder(job.out, settings);
  try {
    if (is_new(job)) {
      scenes = scan_scenes_of(generate_scenes(generation, fresh, job.threads, folder.path() / kJournal));
    }
    ScanResult result = scan_all(job, scenes, folder);
    if (scenes.views.empty()) result.distance = job.distance;
    std::error_code ignored;
    fs::remove(folder.path() / kJournal, ignored);
    folder.commit();
    return result;
  } catch (const Interrupted&) {
    throw Interrupted("interrupted; the same command goes on from " + folder.path().string());
  } catch (const UnusableScene&) {
    folder.discard();
    throw;
  }
}

ordered_json to_json(const ScanJob& job, const ScanResult& result) {
  return {{"scenes", result.scenes},
          {"images", result.images},
          {"models", result.models},
          {"sensor", to_string(job.view.sensor)},
          {"noise_scale", job.view.noise_scale},
          {"seed", job.seed},
          {"threads", job.threads},
          {"distance", result.distance},
          {"resumed", result.resumed},
          {"seconds", result.seconds},
          {"images_per_second", result.images_per_second},
          {"processor_ms_per_image", result.processor_ms_per_image},
          {"out", job.out}};
}

}  // namespace dofusion
