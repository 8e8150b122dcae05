// Stable scenes by dropping or stacking objects, to an HDF5 dataset.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "apps/program.h"
#include "stability/files.h"
#include "stability/generation.h"

using namespace dofusion;

namespace {

constexpr std::int64_t kChunk = 256;            // scenes between looks at the clock
constexpr double kSecondsBetweenSaves = 60.0;   // at most this much work is lost to a kill

// The scenes that an interrupted run with the same settings has left.
SceneDataset resume(const std::string& partial, const std::string& settings) {
  std::error_code error;
  if (!std::filesystem::exists(partial, error)) return {};
  SceneDataset dataset = read_dataset(partial);
  if (dataset.settings != settings) {
    throw InputError(partial + ": left by a run with other settings; delete it or choose another --out");
  }
  std::fprintf(stderr, "continuing with the %zu scenes of %s\n", dataset.scenes.size(), partial.c_str());
  return dataset;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Generates stable scenes by dropping objects one by one, or by stacking them, and simulating until "
               "everything rests.\n\nExample:\n  dofusion-generate --task unstructured --objects 2 --count 10000 --out "
               "two.h5",
               "dofusion-generate"};
  std::string task = "unstructured", shapes = "blocks", out;
  GenerationOptions options;
  std::int64_t count = 1000;
  int threads = default_threads();
  app.add_option("--task", task, "single, unstructured or stack")->capture_default_str();
  app.add_option("--objects", options.objects, "objects in a scene, 1 to 6 (1 for single)")->capture_default_str();
  app.add_option("--shapes", shapes, "blocks (the seven) or general (boxes of random proportions and blocks)")
      ->capture_default_str();
  app.add_option("--count", count, "scenes")->check(CLI::Range(1, 100'000'000))->capture_default_str();
  app.add_option("--seed", options.seed, "the same seed gives the same scenes on any number of threads")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--threads", threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--out", out, "the dataset, HDF5; after a kill the same command goes on from FILE.partial")->required();

  return run_program(app, argc, argv, [&] {
    options.task = task_from_string(task);
    if (options.task == Task::kSingle) options.objects = 1;
    options.shapes = shape_family_from_string(shapes);

    std::vector<std::unique_ptr<SceneGenerator>> generators;
    for (int t = 0; t < threads; ++t) generators.push_back(std::make_unique<SceneGenerator>(options));
    const std::string partial = out + ".partial", settings = to_json(options);
    SceneDataset dataset = resume(partial, settings);
    dataset.shapes = generators.front()->shapes();
    dataset.settings = settings;
    if (static_cast<std::int64_t>(dataset.scenes.size()) > count) dataset.scenes.resize(static_cast<std::size_t>(count));
    if (dataset.scenes.empty()) write_dataset(dataset, partial);  // an --out that cannot be written fails now

    Progress progress("scenes", count, static_cast<std::int64_t>(dataset.scenes.size()));
    auto saved = std::chrono::steady_clock::now();
    while (static_cast<std::int64_t>(dataset.scenes.size()) < count) {
      const auto first = static_cast<std::int64_t>(dataset.scenes.size());
      const std::int64_t chunk = std::min(kChunk, count - first);
      dataset.scenes.resize(static_cast<std::size_t>(first + chunk));
      parallel_for(chunk, threads, [&](std::int64_t i, int thread) {
        if (interrupted()) throw Interrupted("interrupted");
        dataset.scenes[static_cast<std::size_t>(first + i)] = generators[static_cast<std::size_t>(thread)]->generate(first + i);
      });
      progress.update(first + chunk);
      const auto now = std::chrono::steady_clock::now();
      if (std::chrono::duration<double>(now - saved).count() > kSecondsBetweenSaves) {
        write_dataset(dataset, partial);
        saved = now;
      }
    }
    write_dataset(dataset, out);
    std::error_code ignored;
    std::filesystem::remove(partial, ignored);

    GenerationStatistics total;
    for (const auto& generator : generators) {
      total.drops += generator->statistics().drops;
      total.accepted += generator->statistics().accepted;
      total.restarts += generator->statistics().restarts;
    }
    std::printf("%s: %zu scenes; of %ld simulated drops %.0f %% kept, %ld scenes begun anew\n", out.c_str(),
                dataset.scenes.size(), static_cast<long>(total.drops),
                100.0 * static_cast<double>(total.accepted) / static_cast<double>(std::max<std::int64_t>(1, total.drops)),
                static_cast<long>(total.restarts));
  });
}
