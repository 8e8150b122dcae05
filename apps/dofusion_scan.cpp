// Synthetic depth scans of stable scenes, to a dataset in BOP's layout.
#include <array>
#include <atomic>
#include <cstdio>
#include <map>
#include <memory>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "perception/bop_dataset.h"
#include "perception/picture.h"
#include "perception/synthetic_view.h"
#include "stability/dataset.h"
#include "stability/files.h"
#include "stability/generation.h"
#include "stability/parallel_for.h"

using namespace dofusion;

namespace {

constexpr std::uint64_t kViewSeed = 0x5CA4;  // keeps the draws of viewpoints and noise apart from the scenes'

SceneDataset generate_scenes(const GenerationOptions& options, std::int64_t count, int threads) {
  std::vector<std::unique_ptr<SceneGenerator>> generators;
  for (int t = 0; t < threads; ++t) generators.push_back(std::make_unique<SceneGenerator>(options));
  SceneDataset dataset;
  dataset.shapes = generators.front()->shapes();
  dataset.scenes.resize(static_cast<std::size_t>(count));
  Progress progress("scenes", count);
  std::atomic<std::int64_t> done{0};
  parallel_for(count, threads, [&](std::int64_t i, int thread) {
    if (interrupted()) throw Interrupted("interrupted");
    dataset.scenes[static_cast<std::size_t>(i)] = generators[static_cast<std::size_t>(thread)]->generate(i);
    progress.update(++done);
  });
  return dataset;
}

// The distinct solids of a dataset, numbered from 1 as BOP's object ids.
struct Models {
  std::vector<ObjectPtr> objects;
  std::vector<std::vector<int>> ids;  // per scene and object
};

Models collect_models(const SceneDataset& dataset) {
  Models models;
  std::map<std::array<double, 4>, int> id_of;  // by shape and scale
  for (const SceneRecord& record : dataset.scenes) {
    const Scene scene = to_scene(dataset, record);
    models.ids.emplace_back();
    for (std::size_t i = 0; i < record.objects.size(); ++i) {
      const SceneObject& object = record.objects[i];
      const std::array<double, 4> key{static_cast<double>(object.shape), object.scale.x(), object.scale.y(),
                                      object.scale.z()};
      const auto [entry, is_new] = id_of.emplace(key, static_cast<int>(models.objects.size()) + 1);
      if (is_new) models.objects.push_back(scene.objects[i]);
      models.ids.back().push_back(entry->second);
    }
  }
  return models;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Scans stable scenes with a synthetic depth camera and writes a dataset in BOP's layout: depth, masks, "
      "poses, models.\n\nExamples:\n  dofusion-scan --task unstructured --objects 2 --count 100 --out scans\n"
      "  dofusion-scan --data scenes.h5 --cameras 5 --sensor kinect --out scans",
      "dofusion-scan"};
  std::string data, task = "unstructured", shapes = "blocks", sensor = "realsense", split = "test", out, json;
  std::string data_split;
  GenerationOptions generation;
  SyntheticViewOptions view_options;
  Camera camera = default_camera();
  std::vector<int> size{camera.width, camera.height};
  std::int64_t count = 0;
  std::uint64_t seed = 0;
  int cameras = 1, threads = default_threads();
  auto* data_option = app.add_option("--data", data, "scenes of this dataset (HDF5, of dofusion-generate)");
  app.add_option("--data-split", data_split, "only the dataset's scenes of train, validation or test")
      ->needs(data_option);
  app.add_option("--task", task, "or new scenes: single, unstructured or stack")
      ->capture_default_str()
      ->excludes(data_option);
  app.add_option("--objects", generation.objects, "objects in a new scene, 1 to 6 (1 for single)")
      ->capture_default_str()
      ->excludes(data_option);
  app.add_option("--shapes", shapes, "of new scenes: blocks or general")->capture_default_str()->excludes(data_option);
  app.add_option("--count", count, "scenes; 0: all of the dataset, or 10 new ones")->check(CLI::Range(0, 1'000'000));
  app.add_option("--cameras", cameras, "viewpoints a scene")->check(CLI::Range(1, 10'000))->capture_default_str();
  app.add_option("--sensor", sensor, "none, kinect, kinect2, realsense or azure")->capture_default_str();
  app.add_option("--noise-scale", view_options.noise_scale, "multiplies the sensor's noise")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--distance", view_options.viewpoint.distance, "from the camera to the scene's centre, metres")
      ->check(CLI::Range(0.05, 10.0))
      ->capture_default_str();
  app.add_option("--size", size, "width and height in pixels; the field of view stays")
      ->expected(2)
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  app.add_option("--split", split, "name of the folder of scenes")->capture_default_str();
  app.add_option("--seed", seed, "the same seed gives the same scans on any number of threads")->check(CLI::NonNegativeNumber)->capture_default_str();
  app.add_option("--threads", threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", json, "write what was done to this file");
  app.add_option("--out", out, "the dataset's folder")->required();

  return run_program(app, argc, argv, [&] {
    view_options.sensor = sensor_from_string(sensor);
    camera = resized(camera, static_cast<double>(size[0]) / camera.width);
    camera.height = size[1];
    camera.cy = (size[1] - 1) / 2.0;
    generation.task = task_from_string(task);
    if (generation.task == Task::kSingle) generation.objects = 1;
    generation.shapes = shape_family_from_string(shapes);
    generation.seed = seed;
    if (split.empty() || split.find('/') != std::string::npos) throw InputError("--split: not a folder's name");

    if (out.empty()) throw InputError("--out: the name of a folder is needed");
    if (!json.empty()) check_writable(json);
    OutputDirectory directory(out);
    DatasetFilter filter;
    if (!data_split.empty()) filter.split = split_from_string(data_split);
    if (count > 0) filter.most = static_cast<std::size_t>(count);
    const SceneDataset dataset =
        data.empty() ? generate_scenes(generation, count > 0 ? count : 10, threads) : read_dataset(data, filter);
    if (dataset.scenes.empty()) throw InputError(data + ": has no scene to scan");
    const Models models = collect_models(dataset);
    write_bop_models(models.objects, camera, directory.path());

    const auto scenes = static_cast<std::int64_t>(dataset.scenes.size());
    Progress progress("scanned scenes", scenes);
    std::atomic<std::int64_t> done{0};
    parallel_for(scenes, threads, [&](std::int64_t i, int) {
      const auto index = static_cast<std::size_t>(i);
      const Scene scene = to_scene(dataset, dataset.scenes[index]);
      BopSceneWriter writer(scene, models.ids[index], camera,
                            directory.path() / split / bop_scene_name(static_cast<int>(i)));
      Rng rng = make_rng(seed ^ kViewSeed, static_cast<std::uint64_t>(i));
      for (int k = 0; k < cameras; ++k) {
        if (interrupted()) throw Interrupted("interrupted");
        const SyntheticView view = make_synthetic_view(scene, camera, view_options, rng);
        writer.add(view, shaded_picture(scene, camera, view.T_world_camera));
      }
      writer.finish();
      progress.update(++done);
    });
    directory.commit();
    const std::int64_t images = scenes * cameras;
    if (!json.empty()) {
      const nlohmann::ordered_json result{{"scenes", scenes},
                                          {"images", images},
                                          {"models", models.objects.size()},
                                          {"sensor", sensor},
                                          {"noise_scale", view_options.noise_scale},
                                          {"seed", seed},
                                          {"out", out}};
      write_file(json, result.dump(2) + "\n");
    }
    std::printf("%s: %ld images of %ld scenes, %zu models\n", out.c_str(), static_cast<long>(images),
                static_cast<long>(scenes), models.objects.size());
  });
}
