#include "diffusion/torch_network.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include <torch/torch.h>

#include "diffusion/fast_network.h"
#include "stability/random.h"

// Letters in shapes: B scenes, P points, k neighbours, C channels of a layer, S sum of all C, E embedding, H hidden.

namespace dofusion {
namespace {

using torch::Tensor;

constexpr double kSlope = 0.2;

// What both networks share: parameters in one flat leaf tensor, of which the named ones are views, so that autograd
// gives one flat gradient.
class TorchNetwork : public Network {
 public:
  TorchNetwork(const ModelConfig& config, torch::Dtype type) : config_(config), type_(type) {
    check(config, "network");
  }

  const std::vector<TensorInfo>& tensors() const override { return tensors_; }
  bool scenes_are_independent() const override { return false; }

  void set_parameters(const std::vector<float>& parameters) override {
    if (parameters.size() != parameter_count()) throw std::invalid_argument("wrong number of parameters");
    flat_ = torch::tensor(parameters).to(type_);
  }

  std::vector<float> predict(const NetworkInput& input) const override {
    const torch::NoGradGuard no_grad;
    return to_vector(run(input, flat_, false));
  }

  std::vector<float> gradient(const NetworkInput& input, const std::vector<float>& target,
                              std::vector<float>& gradient) override {
    if (target.size() != static_cast<std::size_t>(input.batch) * 6 || gradient.size() != parameter_count())
      throw std::invalid_argument("target or gradient has the wrong size");
    const Tensor parameters = flat_.detach().clone().requires_grad_(true);
    const Tensor output = run(input, parameters, true);  // (B, 6)
    const Tensor wanted = torch::tensor(target).to(type_).view({input.batch, 6});
    const Tensor losses = (output - wanted).square().mean(1);  // (B)
    losses.sum().backward();
    const Tensor result = parameters.grad().to(torch::kFloat32).contiguous();
    const float* values = result.data_ptr<float>();
    for (std::size_t i = 0; i < gradient.size(); ++i) gradient[i] += values[i];
    return to_vector(losses);
  }

 protected:
  // Output (B, 6) of the network with the given flat parameters.
  virtual Tensor run(const NetworkInput& input, const Tensor& parameters, bool training) const = 0;

  void add(const std::string& name, std::vector<std::int64_t> shape, bool trained = true) {
    TensorInfo info;
    info.name = name;
    info.offset = tensors_.empty() ? 0 : tensors_.back().offset + tensors_.back().size;
    info.size = 1;
    for (const std::int64_t n : shape) info.size *= static_cast<std::size_t>(n);
    info.trained = trained;
    info.decays = shape.size() > 1;
    info.shape = std::move(shape);
    index_[info.name] = tensors_.size();
    tensors_.push_back(std::move(info));
  }

  const TensorInfo& info(const std::string& name) const { return tensors_.at(index_.at(name)); }

  Tensor get(const Tensor& parameters, const std::string& name) const {
    const TensorInfo& t = info(name);
    return parameters.narrow(0, static_cast<std::int64_t>(t.offset), static_cast<std::int64_t>(t.size)).view(t.shape);
  }

  static std::vector<float> to_vector(const Tensor& x) {
    const Tensor flat = x.detach().to(torch::kFloat32).contiguous().view(-1);
    return {flat.data_ptr<float>(), flat.data_ptr<float>() + flat.numel()};
  }

  Tensor cloud_of(const NetworkInput& input) const {  // (B, P, 5): the paper's channels
    return torch::tensor(input.cloud).to(type_).view({input.batch, input.points, kCloudChannels}).narrow(2, 0, 5);
  }
  Tensor pose_of(const NetworkInput& input) const {  // (B, pose features)
    const Tensor pose = torch::tensor(input.pose).to(type_).view({input.batch, config_.pose_features()});
    return config_.use_pose ? pose : torch::zeros_like(pose);
  }

  const ModelConfig config_;
  const torch::Dtype type_;
  std::vector<TensorInfo> tensors_;
  std::map<std::string, std::size_t> index_;
  Tensor flat_;
};

// The k nearest of every row of x (B, P, D), itself included: (B, P, k).
Tensor nearest(const Tensor& x, int k) {
  const torch::NoGradGuard no_grad;
  return std::get<1>(torch::cdist(x, x).topk(k, 2, /*largest=*/false, /*sorted=*/false));
}

// Rows of x (B, P, D) at neighbours (B, P, k): (B, P, k, D).
Tensor gather(const Tensor& x, const Tensor& neighbours) {
  const auto B = x.size(0), P = x.size(1), D = x.size(2), k = neighbours.size(2);
  const Tensor first = torch::arange(B, torch::kInt64).view({B, 1, 1}) * P;
  return x.reshape({B * P, D}).index_select(0, (neighbours + first).view(-1)).view({B, P, k, D});
}

Tensor position_and_flag(const Tensor& cloud) { return torch::cat({cloud.narrow(2, 0, 3), cloud.narrow(2, 4, 1)}, 2); }

class PaperNetwork : public TorchNetwork {
 public:
  explicit PaperNetwork(const ModelConfig& config) : TorchNetwork(config, torch::kFloat32) {
    int in = 5, channels = 0;
    for (std::size_t l = 0; l < config.widths.size(); ++l) {
      const std::string name = "encoder.edge" + std::to_string(l + 1);
      add_normed(name, 2 * in, config.widths[l]);
      in = config.widths[l];
      channels += in;
    }
    add_normed("encoder.embed", channels, config.embedding);
    const int sizes[4] = {config.embedding + config.pose_features() + 1, config.hidden, config.hidden, 6};
    for (int l = 0; l < 3; ++l) {
      add("mlp." + std::to_string(l + 1) + ".weight", {sizes[l], sizes[l + 1]});
      add("mlp." + std::to_string(l + 1) + ".bias", {sizes[l + 1]});
    }
  }

  std::vector<float> initial_parameters(std::uint64_t seed) const override {
    std::vector<float> parameters(parameter_count(), 0.0f);
    Rng rng = make_rng(seed, 0x7061706572u);
    for (const TensorInfo& t : tensors_) {
      float* p = parameters.data() + t.offset;
      if (t.shape.size() == 2) {
        const double deviation = std::sqrt(2.0 / static_cast<double>(t.shape[0]));
        for (std::size_t i = 0; i < t.size; ++i) p[i] = static_cast<float>(dofusion::normal(rng, deviation));
      } else if (t.name.find("norm.weight") != std::string::npos || t.name.find("variance") != std::string::npos) {
        std::fill_n(p, t.size, 1.0f);
      }
    }
    return parameters;
  }

  void get_state(std::vector<float>& parameters) const override {
    const Tensor flat = flat_.contiguous();
    for (const TensorInfo& t : tensors_)
      if (!t.trained) std::copy_n(flat.data_ptr<float>() + t.offset, t.size, parameters.data() + t.offset);
  }

 protected:
  Tensor run(const NetworkInput& input, const Tensor& parameters, bool training) const override {
    Tensor cloud = cloud_of(input);
    const Tensor graph_space = position_and_flag(cloud);
    if (!config_.use_sdf) {
      cloud = cloud.clone();
      cloud.select(2, 3).zero_();
    }
    Tensor x = cloud;
    std::vector<Tensor> outputs;
    for (std::size_t l = 0; l < config_.widths.size(); ++l) {
      const Tensor neighbours = nearest(l == 0 ? graph_space : x.detach(), config_.neighbours);
      const Tensor others = gather(x, neighbours);  // (B, P, k, C_in)
      const Tensor centre = x.unsqueeze(2).expand_as(others);
      const Tensor edges = torch::cat({centre, others - centre}, 3);                            // (B, P, k, 2 C_in)
      x = normed("encoder.edge" + std::to_string(l + 1), edges, parameters, training).amax(2);  // (B, P, C)
      outputs.push_back(x);
    }
    const Tensor latent = normed("encoder.embed", torch::cat(outputs, 2), parameters, training).amax(1);  // (B, E)

    // t / T: with geometric scales, the logarithm's place between the smallest and the largest.
    const Tensor sigma = torch::tensor(input.sigma);
    const Tensor t = (sigma / config_.sigma_min).log() / std::log(config_.sigma_max / config_.sigma_min);
    Tensor y = torch::cat({latent, pose_of(input), t.view({-1, 1})}, 1);
    for (int l = 1; l <= 3; ++l) {
      const std::string name = "mlp." + std::to_string(l);
      y = y.matmul(get(parameters, name + ".weight")) + get(parameters, name + ".bias");
      if (l < 3) y = y.relu();
    }
    return y;
  }

 private:
  void add_normed(const std::string& name, int in, int out) {
    add(name + ".weight", {in, out});
    add(name + ".norm.weight", {out});
    add(name + ".norm.bias", {out});
    add(name + ".norm.running_mean", {out}, false);
    add(name + ".norm.running_variance", {out}, false);
  }

  // Linear map, batch norm over everything but the last dimension, leaky ReLU.
  Tensor normed(const std::string& name, const Tensor& x, const Tensor& parameters, bool training) const {
    const Tensor weight = get(parameters, name + ".weight");
    const Tensor y = x.reshape({-1, weight.size(0)}).matmul(weight);
    // The running statistics live in flat_ and are updated in place.
    Tensor mean = get(flat_, name + ".norm.running_mean"), variance = get(flat_, name + ".norm.running_variance");
    const Tensor z = torch::batch_norm(y, get(parameters, name + ".norm.weight"), get(parameters, name + ".norm.bias"),
                                       mean, variance, training, 0.1, 1e-5, false);
    std::vector<std::int64_t> shape = x.sizes().vec();
    shape.back() = weight.size(1);
    return torch::leaky_relu(z, kSlope).view(shape);
  }
};

class ReferenceNetwork : public TorchNetwork {
 public:
  ReferenceNetwork(const ModelConfig& config, torch::Dtype type) : TorchNetwork(config, type), fast_(config) {
    for (const TensorInfo& t : fast_.tensors()) add(t.name, t.shape, t.trained);
  }

  std::vector<float> initial_parameters(std::uint64_t seed) const override { return fast_.initial_parameters(seed); }

 protected:
  Tensor run(const NetworkInput& input, const Tensor& parameters, bool) const override {
    const int B = input.batch, P = input.points, F = config_.point_features();
    std::vector<float> features(static_cast<std::size_t>(B) * P * F);
    const int noise_count = 1 + 2 * config_.noise_frequencies;
    std::vector<float> noise(static_cast<std::size_t>(B) * noise_count);
    for (int b = 0; b < B; ++b) {
      point_features(config_, input.cloud.data() + static_cast<std::size_t>(b) * P * kCloudChannels, P, input.sigma[b],
                     features.data() + static_cast<std::size_t>(b) * P * F, F);
      noise_features(config_, input.sigma[b], noise.data() + static_cast<std::size_t>(b) * noise_count);
    }
    const Tensor neighbours = nearest(position_and_flag(cloud_of(input)), config_.neighbours);  // (B, P, k)
    Tensor x = torch::tensor(features).to(type_).view({B, P, F});
    std::vector<Tensor> outputs;
    for (std::size_t l = 0; l < config_.widths.size(); ++l) {
      const std::string name = "encoder.edge" + std::to_string(l + 1);
      const Tensor weight = get(parameters, name + ".weight");  // (C_in, 2 C)
      const std::int64_t C = config_.widths[l];
      const Tensor self = x.matmul(weight.narrow(1, 0, C));  // (B, P, C)
      const Tensor others = x.matmul(weight.narrow(1, C, C));
      const Tensor y = self + gather(others, neighbours).amax(2);
      x = torch::leaky_relu(norm(name, y, parameters), kSlope);
      outputs.push_back(x);
    }
    const Tensor points = torch::cat(outputs, 2);                                            // (B, P, S)
    const Tensor best = points.matmul(get(parameters, "encoder.embed.weight").t()).amax(1);  // (B, E)
    const Tensor pooled = torch::leaky_relu(norm("encoder.embed", best, parameters), kSlope);
    Tensor y =
        torch::cat({pooled, points.mean(1), torch::tensor(noise).to(type_).view({B, noise_count}), pose_of(input)}, 1);
    Tensor scene;
    for (int l = 1; l <= 3; ++l) {
      const std::string name = "mlp." + std::to_string(l);
      if (l == 3) scene = y;
      y = y.matmul(get(parameters, name + ".weight")) + get(parameters, name + ".bias");
      if (l == 3 && config_.point_head > 0) return y + forces(input, points, scene, parameters);
      if (l < 3) y = torch::leaky_relu(y, kSlope);
    }
    return y;
  }

 private:
  // What point_head.h adds to the output. points (B, P, S), scene (B, hidden).
  Tensor forces(const NetworkInput& input, const Tensor& points, const Tensor& scene, const Tensor& parameters) const {
    const Tensor cloud = cloud_of(input), on_query = cloud.select(2, 4).unsqueeze(2);  // (B, P, 1)
    const Tensor count = on_query.sum(1);                                              // (B, 1)
    const Tensor scene_term =
        scene.matmul(get(parameters, "head.scene.weight")) + get(parameters, "head.bias");  // (B, H)
    const Tensor hidden = torch::leaky_relu(
        points.matmul(get(parameters, "head.local.weight")) + scene_term.unsqueeze(1), kSlope);  // (B, P, H)
    const Tensor force = hidden.matmul(get(parameters, "head.force.weight")) * on_query;         // (B, P, 3)
    const Tensor position = cloud.narrow(2, 0, 3);
    Tensor origin = torch::zeros({input.batch, 3}, torch::dtype(type_));
    if (config_.use_pose)
      origin.select(1, 2).copy_(pose_of(input).select(1, 9));
    else
      origin.select(1, 2).copy_(((position * on_query).sum(1) / count).select(1, 2));
    const Tensor moment = torch::cross((position - origin.unsqueeze(1)), force, 2);
    return torch::cat({force.sum(1) / count, moment.sum(1) / count}, 1);
  }

  Tensor norm(const std::string& name, const Tensor& x, const Tensor& parameters) const {
    return torch::layer_norm(x, {x.size(-1)}, get(parameters, name + ".norm.weight"),
                             get(parameters, name + ".norm.bias"), 1e-5);
  }

  FastNetwork fast_;
};

}  // namespace

void enable_torch_networks(int threads) {
  torch::set_num_threads(threads);
  register_paper_network(&make_paper_network);
}

std::unique_ptr<Network> make_paper_network(const ModelConfig& config) {
  return std::make_unique<PaperNetwork>(config);
}

std::unique_ptr<Network> make_reference_network(const ModelConfig& config, bool float64) {
  return std::make_unique<ReferenceNetwork>(config, float64 ? torch::kFloat64 : torch::kFloat32);
}

}  // namespace dofusion
