// The default preset's network against the same network in plain libtorch operations, and its kernels.
#include <benchmark/benchmark.h>

#include "diffusion/fast_network.h"
#include "diffusion/kernels.h"
#include "diffusion/torch_network.h"
#include "stability/random.h"

namespace dofusion {
namespace {

NetworkInput random_input(const ModelConfig& config, int batch) {
  Rng rng = make_rng(1);
  NetworkInput input;
  input.batch = batch;
  input.points = config.points;
  for (int i = 0; i < batch * config.points; ++i) {
    for (int d = 0; d < kCloudChannels; ++d) input.cloud.push_back(static_cast<float>(normal(rng)));
    input.cloud[input.cloud.size() - kCloudChannels + 4] = i % 3 == 0 ? 1.0f : 0.0f;
  }
  for (int i = 0; i < batch * config.pose_features(); ++i) input.pose.push_back(static_cast<float>(normal(rng)));
  input.sigma.assign(batch, 0.1f);
  return input;
}

ModelConfig config_of(Preset preset, int points) {
  ModelConfig config = make_config(preset);
  config.points = points;
  return config;
}

// One training step's forward and backward pass; items are scenes.
void gradient(benchmark::State& state, const ModelConfig& config, std::unique_ptr<Network> network, int batch) {
  network->set_parameters(network->initial_parameters(1));
  const NetworkInput input = random_input(config, batch);
  const std::vector<float> target(static_cast<std::size_t>(batch) * 6, 0.5f);
  std::vector<float> sum(network->parameter_count());
  for (auto _ : state) benchmark::DoNotOptimize(network->gradient(input, target, sum));
  state.SetItemsProcessed(state.iterations() * batch);
}

void predict(benchmark::State& state, const ModelConfig& config, std::unique_ptr<Network> network, int batch) {
  network->set_parameters(network->initial_parameters(1));
  const NetworkInput input = random_input(config, batch);
  for (auto _ : state) benchmark::DoNotOptimize(network->predict(input));
  state.SetItemsProcessed(state.iterations() * batch);
}

void register_all() {
  for (const int points : {192, 384}) {
    const ModelConfig config = config_of(Preset::kDefault, points);
    const std::string size = "/" + std::to_string(points) + "_points";
    for (const char* version : {"avx512_bf16", "avx512", "avx2", "generic"}) {
      const kernels::Kernels* kernels = kernels::by_name(version);
      if (!kernels) continue;
      benchmark::RegisterBenchmark(("gradient/" + std::string(version) + size).c_str(), [=](benchmark::State& state) {
        gradient(state, config, std::make_unique<FastNetwork>(config, kernels), 8);
      });
      benchmark::RegisterBenchmark(("predict/" + std::string(version) + size).c_str(), [=](benchmark::State& state) {
        predict(state, config, std::make_unique<FastNetwork>(config, kernels), 8);
      });
    }
    benchmark::RegisterBenchmark(("gradient/libtorch" + size).c_str(), [=](benchmark::State& state) {
      gradient(state, config, make_reference_network(config), 8);
    });
    const ModelConfig paper = config_of(Preset::kPaper, points);
    benchmark::RegisterBenchmark(("gradient/paper_libtorch" + size).c_str(), [=](benchmark::State& state) {
      gradient(state, paper, make_paper_network(paper), 16);
    });
  }
}

}  // namespace
}  // namespace dofusion

int main(int argc, char** argv) {
  dofusion::enable_torch_networks(1);
  dofusion::register_all();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
