// Settling against the bare mj_step calls that it makes, scenes generated and placements judged a second. Ratios are
// what counts: run all in one go on a quiet machine.
//
//   settling_bench
//
// BM_BareSteps/n and BM_Settle/n: n blocks at rest on the table, `steps` simulated steps an iteration; the ratio of
// their times is the overhead of settling. BM_Generate/task/n: `scenes` a second on one thread.
// BM_JudgePlacements: placements of three-block scenes, disturbed by up to a centimetre, a second on one thread.
#include <benchmark/benchmark.h>
#include <mujoco/mujoco.h>

#include <memory>

#include "stability/generation.h"
#include "stability/mjcf.h"
#include "stability/mujoco_model.h"
#include "stability/outcome.h"

namespace {

using namespace dofusion;

constexpr std::uint64_t kSeed = 4242;

// Stable scenes, the same in every run.
std::vector<Scene> stable_scenes(int objects, int count) {
  GenerationOptions options;
  options.task = objects == 1 ? Task::kSingle : Task::kUnstructured;
  options.objects = objects;
  options.seed = kSeed;
  SceneGenerator generator(options);
  SceneDataset dataset;
  dataset.shapes = generator.shapes();
  std::vector<Scene> scenes;
  for (int i = 0; i < count; ++i) scenes.push_back(to_scene(dataset, generator.generate(i)));
  return scenes;
}

// The same simulation twice: by Simulator::run, and by mj_step alone.
struct Twin {
  Scene scene;
  std::unique_ptr<Simulator> simulator;
  ModelPtr model;
  DataPtr data;
};

std::vector<Twin> twins(int objects) {
  std::vector<Twin> all;
  for (Scene& scene : stable_scenes(objects, 16)) {
    Twin twin;
    twin.simulator = std::make_unique<Simulator>(scene.objects);
    twin.model = compile_mjcf(mjcf_text(scene.objects, scene.T_world_object, {}));
    twin.data = make_data(*twin.model);
    twin.scene = std::move(scene);
    all.push_back(std::move(twin));
  }
  return all;
}

constexpr int kSteps = 100;  // of a drop; what a settling takes

void BM_BareSteps(benchmark::State& state) {
  const auto all = twins(static_cast<int>(state.range(0)));
  std::size_t next = 0;
  for (auto _ : state) {
    const Twin& twin = all[next++ % all.size()];
    mj_resetData(twin.model.get(), twin.data.get());
    for (int k = 0; k < kSteps; ++k) mj_step(twin.model.get(), twin.data.get());
  }
  state.counters["us_a_step"] = benchmark::Counter(
      static_cast<double>(kSteps) * 1e-6, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_BareSteps)->DenseRange(1, 3)->Unit(benchmark::kMillisecond);

void BM_Settle(benchmark::State& state) {
  const auto all = twins(static_cast<int>(state.range(0)));
  std::size_t next = 0;
  PhysicsOptions options;
  for (auto _ : state) {
    const Twin& twin = all[next++ % all.size()];
    // Until it rests, which it does at once, or for as many steps as the bare run makes.
    benchmark::DoNotOptimize(twin.simulator->run(twin.scene.T_world_object, {}, {kSteps * options.timestep, false}));
  }
  state.counters["us_a_step"] = benchmark::Counter(
      static_cast<double>(kSteps) * 1e-6, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_Settle)->DenseRange(1, 3)->Unit(benchmark::kMillisecond);

void BM_Generate(benchmark::State& state) {
  GenerationOptions options;
  options.task = static_cast<Task>(state.range(0));
  options.objects = static_cast<int>(state.range(1));
  options.seed = kSeed;
  SceneGenerator generator(options);
  std::int64_t index = 0;
  for (; index < 2000; ++index) generator.generate(index);  // builds the models, which a job does once
  for (auto _ : state) benchmark::DoNotOptimize(generator.generate(index++));
  state.counters["scenes"] = benchmark::Counter(1, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(BM_Generate)
    ->ArgNames({"task", "objects"})
    ->Args({0, 1})
    ->Args({1, 2})
    ->Args({1, 3})
    ->Args({2, 2})
    ->Args({2, 3})
    ->Iterations(400)  // in one go: the models are built once
    ->Unit(benchmark::kMillisecond);

void BM_JudgePlacements(benchmark::State& state) {
  const std::vector<Scene> scenes = stable_scenes(3, 64);
  SimulatorCache simulators;
  for (const Scene& scene : scenes) simulators.get(scene.objects);
  std::uint64_t next = 0;
  for (auto _ : state) {
    const Scene& scene = scenes[next % scenes.size()];
    Rng rng = make_rng(kSeed, next++);
    std::vector<Pose> poses = scene.T_world_object;
    poses.back().translation() += normal3(rng, 0.005);
    const SettleResult settled = simulators.get(scene.objects).settle(poses);
    benchmark::DoNotOptimize(judge(scene.objects, poses, settled, 2));
  }
  state.counters["placements"] = benchmark::Counter(1, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(BM_JudgePlacements)->Iterations(800)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
