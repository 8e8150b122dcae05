// The default preset's hand-written network against the same in libtorch, with autograd.
#include "diffusion/fast_network.h"

#include <cmath>

#include <gtest/gtest.h>

#include "diffusion/kernels.h"
#include "diffusion/torch_network.h"
#include "stability/random.h"

namespace dofusion {
namespace {

ModelConfig small_config() {
  ModelConfig config;
  config.points = 64;
  config.neighbours = 16;
  config.widths = {32, 64, 32};
  config.embedding = 64;
  config.hidden = 64;
  config.directions = true;
  config.point_head = 32;
  return config;
}

NetworkInput random_input(const ModelConfig& config, int batch, std::uint64_t seed) {
  Rng rng = make_rng(seed);
  NetworkInput input;
  input.batch = batch;
  input.points = config.points;
  for (int i = 0; i < batch * config.points; ++i) {
    for (int d = 0; d < kCloudChannels; ++d) input.cloud.push_back(static_cast<float>(normal(rng)));
    input.cloud[input.cloud.size() - kCloudChannels + 4] = i % 3 == 0 ? 1.0f : 0.0f;
  }
  for (int i = 0; i < batch * config.pose_features(); ++i) input.pose.push_back(static_cast<float>(normal(rng)));
  for (int i = 0; i < batch; ++i) input.sigma.push_back(static_cast<float>(std::exp(uniform(rng, -5.0, 1.0))));
  return input;
}

std::vector<float> random_parameters(const Network& network, std::uint64_t seed) {
  std::vector<float> parameters = network.initial_parameters(seed);
  Rng rng = make_rng(seed, 1);
  for (const TensorInfo& t : network.tensors()) {
    const bool matrix = t.shape.size() > 1;
    for (std::size_t i = 0; i < t.size; ++i)
      parameters[t.offset + i] += static_cast<float>(normal(rng, matrix ? 0.0 : 0.2));
    if (t.name == "mlp.3.weight" || t.name == "head.force.weight")
      for (std::size_t i = 0; i < t.size; ++i) parameters[t.offset + i] *= 20.0f;
  }
  return parameters;
}

double norm(const std::vector<float>& x, const TensorInfo& t) {
  double sum = 0;
  for (std::size_t i = 0; i < t.size; ++i) sum += double(x[t.offset + i]) * x[t.offset + i];
  return std::sqrt(sum);
}

double difference(const std::vector<float>& x, const std::vector<float>& y, const TensorInfo& t) {
  double sum = 0;
  for (std::size_t i = 0; i < t.size; ++i) {
    const double d = double(x[t.offset + i]) - y[t.offset + i];
    sum += d * d;
  }
  return std::sqrt(sum);
}

class FastNetworkTest : public testing::TestWithParam<const char*> {};

TEST_P(FastNetworkTest, AgreesWithLibtorch) {
  const kernels::Kernels* kernels = kernels::by_name(GetParam());
  if (!kernels) GTEST_SKIP() << "this processor has no " << GetParam();
  const ModelConfig config = small_config();
  FastNetwork fast(config, kernels);
  const std::vector<float> parameters = random_parameters(fast, 3);
  const auto reference = make_reference_network(config);
  fast.set_parameters(parameters);
  reference->set_parameters(parameters);
  const NetworkInput input = random_input(config, 9, 4);
  const std::vector<float> a = fast.predict(input), b = reference->predict(input);
  ASSERT_EQ(a.size(), b.size());
  double size = 0, error = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    size += b[i] * b[i];
    error += (a[i] - b[i]) * (a[i] - b[i]);
  }
  // Operands rounded to 8 bits: 0.2 % a value, which averages out over sums and adds up over five layers.
  EXPECT_LT(std::sqrt(error / size), 0.02);

  std::vector<float> target(a.size());
  Rng rng = make_rng(5);
  for (float& v : target) v = static_cast<float>(normal(rng));
  std::vector<float> gradient(parameters.size()), expected(parameters.size());
  const std::vector<float> losses = fast.gradient(input, target, gradient);
  const std::vector<float> expected_losses = reference->gradient(input, target, expected);
  for (std::size_t i = 0; i < losses.size(); ++i)
    EXPECT_NEAR(losses[i], expected_losses[i], 0.05 * expected_losses[i] + 0.01);
  // Rounding also changes which neighbour holds a maximum now and then, which moves single gradients as a whole.
  for (const TensorInfo& t : fast.tensors())
    EXPECT_LT(difference(gradient, expected, t), 0.12 * norm(expected, t)) << t.name;
}

INSTANTIATE_TEST_SUITE_P(Versions, FastNetworkTest, testing::Values("avx512_bf16", "avx512", "avx2", "generic"),
                         [](const auto& version) { return std::string(version.param); });

// The reference's own gradient by central differences in double precision, along each tensor's gradient.
TEST(ReferenceNetwork, GradientAgreesWithFiniteDifferences) {
  const ModelConfig config = small_config();
  const auto network = make_reference_network(config, /*float64=*/true);
  const std::vector<float> parameters = random_parameters(*network, 6);
  const NetworkInput input = random_input(config, 2, 7);
  std::vector<float> target(12, 0.3f), gradient(parameters.size());
  network->set_parameters(parameters);
  network->gradient(input, target, gradient);
  for (const TensorInfo& t : network->tensors()) {
    // Parameters are handed over in single precision, so the step may not be tiny: 1e-3 of the tensor's length.
    const double length = norm(gradient, t), step = 1e-3 * std::max(1.0, norm(parameters, t));
    double moved = 0.0;
    const auto loss = [&](double e) {
      std::vector<float> p = parameters, unused(parameters.size());
      for (std::size_t i = 0; i < t.size; ++i)
        p[t.offset + i] += static_cast<float>(e * gradient[t.offset + i] / length);
      network->set_parameters(p);
      double sum = 0;
      for (const float l : network->gradient(input, target, unused)) sum += l;
      moved = 0;
      for (std::size_t i = 0; i < t.size; ++i)
        moved += (double(p[t.offset + i]) - parameters[t.offset + i]) * gradient[t.offset + i];
      return sum;
    };
    const double up = loss(step), moved_up = moved, down = loss(-step), moved_down = moved;
    EXPECT_NEAR((up - down) / (moved_up - moved_down), 1.0, 0.03) << t.name;  // kinks of maximum and activation
  }
}

TEST(FastNetwork, RowsDoNotDependOnTheBatch) {
  const ModelConfig config = small_config();
  FastNetwork network(config);
  network.set_parameters(random_parameters(network, 8));
  const NetworkInput batch = random_input(config, 13, 9);
  const std::vector<float> all = network.predict(batch);
  for (int b = 0; b < batch.batch; ++b) {
    NetworkInput one;
    one.batch = 1;
    one.points = batch.points;
    const auto part = [&](const std::vector<float>& x) {
      const auto n = static_cast<std::ptrdiff_t>(x.size() / batch.batch);
      return std::vector<float>(x.begin() + b * n, x.begin() + (b + 1) * n);
    };
    one.cloud = part(batch.cloud);
    one.pose = part(batch.pose);
    one.sigma = part(batch.sigma);
    EXPECT_EQ(network.predict(one), part(all));
  }
}

TEST(FastNetwork, SizesAreChecked) {
  const ModelConfig config = small_config();
  FastNetwork network(config);
  EXPECT_THROW(network.set_parameters({1.0f}), std::invalid_argument);
  network.set_parameters(network.initial_parameters(1));
  NetworkInput input = random_input(config, 2, 1);
  input.sigma.pop_back();
  EXPECT_THROW(network.predict(input), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
