#include "diffusion/fast_network.h"

#include <cmath>
#include <mutex>
#include <stdexcept>

#include "diffusion/fast_encoder.h"
#include "diffusion/kernels.h"
#include "diffusion/point_head.h"
#include "stability/random.h"

namespace dofusion {
namespace {

std::size_t area(int rows, int columns) { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns); }

struct Linear {
  int in = 0, out = 0;
  std::size_t weight = 0;         // (in, out)
  std::size_t bias = 0;           // (out)
  std::vector<float> transposed;  // (out, in of which a gradient is wanted, rounded up to 16)
  int wanted = 0;
};

}  // namespace

void point_features(const ModelConfig& config, const float* cloud, int points, float sigma, float* features, int row) {
  const float range = static_cast<float>(std::log(config.sigma_max / config.sigma_min));
  const float noise = 2.0f * std::log(sigma / static_cast<float>(config.sigma_min)) / range - 1.0f;
  for (int i = 0; i < points; ++i, cloud += kCloudChannels, features += row) {
    const float sdf = config.use_sdf ? cloud[3] : 0.0f;
    float* out = features;
    *out++ = cloud[0];
    *out++ = cloud[1];
    *out++ = cloud[2];
    *out++ = sdf;
    *out++ = cloud[4];
    *out++ = noise;
    for (const double scale : config.contact_scales) {
      const float s = static_cast<float>(scale);
      *out++ = cloud[2] / (std::abs(cloud[2]) + s);
      *out++ = sdf / (std::abs(sdf) + s);
    }
    if (!config.directions) continue;
    for (int d = 0; d < 3; ++d) *out++ = cloud[5 + d];
    for (int d = 0; d < 3; ++d) *out++ = config.use_sdf ? cloud[8 + d] : 0.0f;
  }
}

void noise_features(const ModelConfig& config, float sigma, float* out) {
  const double range = std::log(config.sigma_max / config.sigma_min);
  const double u = 2.0 * std::log(sigma / config.sigma_min) / range - 1.0;
  *out++ = static_cast<float>(u);
  for (int i = 1; i <= config.noise_frequencies; ++i) {
    *out++ = static_cast<float>(std::sin(0.5 * M_PI * i * u));
    *out++ = static_cast<float>(std::cos(0.5 * M_PI * i * u));
  }
}

// B scenes; D0 = E + S + noise + pose features enters the MLP.
struct FastNetwork::Impl {
  ModelConfig config;
  const kernels::Kernels& kernels;
  std::vector<TensorInfo> tensors;
  std::unique_ptr<FastEncoder> encoder;
  Linear mlp[3];
  std::unique_ptr<PointHead> head;           // null without
  std::size_t head_scene = 0;                // (hidden, H)
  std::size_t head_bias = 0;                 // (H)
  std::vector<float> head_scene_transposed;  // (H, hidden)
  std::vector<float> parameters;

  struct Workspace {
    FastEncoder::Scratch scratch;
    std::vector<FastEncoder::Saved> saved;
    std::vector<float> input, hidden[2], output;        // (B, D0), (B, hidden), (B, 16)
    std::vector<float> d_input, d_hidden[2], d_output;  // (B, E + S), (B, hidden), (B, 16)
    PointHead::Scratch head_scratch;
    std::vector<PointHead::Saved> head_saved;
    std::vector<float> scene_term, d_scene_term;  // (B, H)
  };
  // Workspaces are large; each call borrows one.
  mutable std::mutex mutex;
  mutable std::vector<std::unique_ptr<Workspace>> idle;

  std::unique_ptr<Workspace> borrow() const {
    const std::lock_guard<std::mutex> lock(mutex);
    if (idle.empty()) return std::make_unique<Workspace>();
    auto workspace = std::move(idle.back());
    idle.pop_back();
    return workspace;
  }
  void give_back(std::unique_ptr<Workspace> workspace) const {
    const std::lock_guard<std::mutex> lock(mutex);
    idle.push_back(std::move(workspace));
  }

  Impl(const ModelConfig& c, const kernels::Kernels& k) : config(c), kernels(k) {
    std::vector<FastEncoder::LayerOffsets> layers;
    int in = config.point_features(), channels = 0;
    for (std::size_t l = 0; l < config.widths.size(); ++l) {
      const std::string name = "encoder.edge" + std::to_string(l + 1);
      const int out = config.widths[l];
      FastEncoder::LayerOffsets offsets;
      offsets.weight = add(name + ".weight", {in, 2 * out});
      offsets.gamma = add(name + ".norm.weight", {out});
      offsets.beta = add(name + ".norm.bias", {out});
      layers.push_back(offsets);
      in = out;
      channels += out;
    }
    const std::size_t weight = add("encoder.embed.weight", {config.embedding, channels});
    const std::size_t gamma = add("encoder.embed.norm.weight", {config.embedding});
    const std::size_t beta = add("encoder.embed.norm.bias", {config.embedding});
    encoder = std::make_unique<FastEncoder>(config, kernels, layers, weight, gamma, beta);

    const int pooled = encoder->pooled();
    const int sizes[4] = {pooled + 1 + 2 * config.noise_frequencies + config.pose_features(), config.hidden,
                          config.hidden, 6};
    for (int l = 0; l < 3; ++l) {
      const std::string name = "mlp." + std::to_string(l + 1);
      mlp[l].in = sizes[l];
      mlp[l].out = sizes[l + 1];
      mlp[l].wanted = l == 0 ? pooled : sizes[l];
      mlp[l].weight = add(name + ".weight", {sizes[l], sizes[l + 1]});
      mlp[l].bias = add(name + ".bias", {sizes[l + 1]});
    }
    if (config.point_head == 0) return;
    PointHead::Offsets offsets;
    offsets.local = add("head.local.weight", {encoder->channels(), config.point_head});
    head_scene = add("head.scene.weight", {config.hidden, config.point_head});
    offsets.bias = add("head.bias", {config.point_head});
    offsets.force = add("head.force.weight", {config.point_head, 3});
    head_bias = offsets.bias;
    head = std::make_unique<PointHead>(config, kernels, encoder->channels(), offsets);
  }

  std::size_t add(const std::string& name, std::vector<std::int64_t> shape) {
    TensorInfo info;
    info.name = name;
    info.offset = tensors.empty() ? 0 : tensors.back().offset + tensors.back().size;
    info.size = 1;
    for (const std::int64_t n : shape) info.size *= static_cast<std::size_t>(n);
    info.decays = shape.size() > 1;
    info.shape = std::move(shape);
    tensors.push_back(info);
    return info.offset;
  }

  // Rows of 16 floats beyond 6 outputs keep the product's columns a multiple of 16.
  int padded(int columns) const { return (columns + 15) / 16 * 16; }

  void check_input(const NetworkInput& input) const {
    if (input.points < std::max(16, config.neighbours) || input.points % 2 != 0 || input.points > 4096)
      throw std::invalid_argument("clouds need an even number of points from 16 to 4096, not " +
                                  std::to_string(input.points));
    if (input.cloud.size() != area(input.batch, input.points * kCloudChannels) ||
        input.pose.size() != area(input.batch, config.pose_features()) ||
        input.sigma.size() != static_cast<std::size_t>(input.batch))
      throw std::invalid_argument("network input arrays do not have the batch's size");
  }

  void forward(const NetworkInput& input, Workspace& w, bool keep) const {
    const int batch = input.batch, pooled = encoder->pooled(), pose_count = config.pose_features();
    const int noise_count = 1 + 2 * config.noise_frequencies;
    // The head needs every scene's features after the MLP.
    keep = keep || head != nullptr;
    if (w.saved.size() < static_cast<std::size_t>(keep ? batch : 1)) w.saved.resize(keep ? batch : 1);
    w.input.resize(area(batch, mlp[0].in));
    for (int b = 0; b < batch; ++b) {
      float* row = w.input.data() + area(b, mlp[0].in);
      encoder->forward(input.cloud.data() + area(b, input.points * kCloudChannels), input.points, input.sigma[b],
                       w.saved[keep ? b : 0], w.scratch, row);
      noise_features(config, input.sigma[b], row + pooled);
      for (int i = 0; i < pose_count; ++i)
        row[pooled + noise_count + i] = config.use_pose ? input.pose[area(b, pose_count) + i] : 0.0f;
    }
    const float* x = w.input.data();
    for (int l = 0; l < 3; ++l) {
      std::vector<float>& y = l < 2 ? w.hidden[l] : w.output;
      const int columns = padded(mlp[l].out);
      y.assign(area(batch, columns), 0.0f);
      for (int b = 0; b < batch; ++b)
        std::copy_n(parameters.data() + mlp[l].bias, mlp[l].out, y.data() + area(b, columns));
      const float* weight = l < 2 ? parameters.data() + mlp[l].weight : last_weight.data();
      kernels.matmul_f32(batch, columns, mlp[l].in, x, mlp[l].in, 1, weight, columns, y.data(), columns, true);
      if (l < 2)
        for (float& v : y) v = v > 0 ? v : kernels::kLeakySlope * v;
      x = y.data();
    }
    if (head) add_forces(input, w);
  }

  void add_forces(const NetworkInput& input, Workspace& w) const {
    const int batch = input.batch, H = config.point_head;
    w.scene_term.resize(area(batch, H));
    for (int b = 0; b < batch; ++b) std::copy_n(parameters.data() + head_bias, H, w.scene_term.data() + area(b, H));
    kernels.matmul_f32(batch, H, config.hidden, w.hidden[1].data(), config.hidden, 1, parameters.data() + head_scene, H,
                       w.scene_term.data(), H, true);
    if (w.head_saved.size() < static_cast<std::size_t>(batch)) w.head_saved.resize(batch);
    for (int b = 0; b < batch; ++b) {
      const float origin_z = input.pose[area(b, config.pose_features()) + 9];
      head->forward(input.cloud.data() + area(b, input.points * kCloudChannels), input.points, origin_z,
                    w.saved[b].concatenated.data(), w.scene_term.data() + area(b, H), w.head_saved[b], w.head_scratch,
                    w.output.data() + area(b, padded(6)));
    }
  }

  // d_output -> d_input and the gradient of head and MLP.
  void backward(const NetworkInput& input, Workspace& w, float* gradient) const {
    const int batch = input.batch;
    const float* x[3] = {w.input.data(), w.hidden[0].data(), w.hidden[1].data()};
    std::vector<float>* d_x[3] = {&w.d_input, &w.d_hidden[0], &w.d_hidden[1]};
    const float* d_y = w.d_output.data();
    for (int l = 2; l >= 0; --l) {
      const Linear& layer = mlp[l];
      const int columns = padded(layer.out), wanted = padded(layer.wanted);
      float* d_bias = gradient + layer.bias;
      for (int b = 0; b < batch; ++b)
        for (int j = 0; j < layer.out; ++j) d_bias[j] += d_y[area(b, columns) + j];
      float* d_weight = gradient + layer.weight;
      if (l < 2) {
        kernels.matmul_f32(layer.in, columns, batch, x[l], 1, layer.in, d_y, columns, d_weight, columns, true);
      } else {
        for (int b = 0; b < batch; ++b)
          for (int i = 0; i < layer.in; ++i)
            for (int j = 0; j < layer.out; ++j)
              d_weight[area(i, layer.out) + j] += x[l][area(b, layer.in) + i] * d_y[area(b, columns) + j];
      }
      d_x[l]->resize(area(batch, wanted));
      kernels.matmul_f32(batch, wanted, layer.out, d_y, columns, 1, layer.transposed.data(), wanted, d_x[l]->data(),
                         wanted, false);
      if (l == 2 && head) head_backward(input, w, gradient);
      if (l > 0)
        for (std::size_t i = 0; i < d_x[l]->size(); ++i)
          if (x[l][i] <= 0) (*d_x[l])[i] *= kernels::kLeakySlope;
      d_y = d_x[l]->data();
    }
  }

  // Adds to the gradient of the last hidden layer, too.
  void head_backward(const NetworkInput& input, Workspace& w, float* gradient) const {
    const int batch = input.batch, H = config.point_head;
    w.d_scene_term.assign(area(batch, H), 0.0f);
    for (int b = 0; b < batch; ++b)
      head->backward(w.head_saved[b], w.d_output.data() + area(b, padded(6)), w.head_scratch, gradient,
                     w.d_scene_term.data() + area(b, H));
    kernels.matmul_f32(config.hidden, H, batch, w.hidden[1].data(), 1, config.hidden, w.d_scene_term.data(), H,
                       gradient + head_scene, H, true);
    kernels.matmul_f32(batch, config.hidden, H, w.d_scene_term.data(), H, 1, head_scene_transposed.data(),
                       config.hidden, w.d_hidden[1].data(), config.hidden, true);
  }

  std::vector<float> last_weight;  // (hidden, 16): the output layer's weights filled up with zeros
};

FastNetwork::FastNetwork(const ModelConfig& config, const kernels::Kernels* kernels) {
  check(config, "network");
  impl_ = std::make_unique<Impl>(config, kernels ? *kernels : kernels::best());
}
FastNetwork::~FastNetwork() = default;

const std::vector<TensorInfo>& FastNetwork::tensors() const { return impl_->tensors; }

std::vector<float> FastNetwork::initial_parameters(std::uint64_t seed) const {
  std::vector<float> parameters(parameter_count(), 0.0f);
  Rng rng = make_rng(seed, 0x776569676874u);
  for (const TensorInfo& t : impl_->tensors) {
    float* p = parameters.data() + t.offset;
    if (t.shape.size() == 1) {
      if (t.name.find("norm.weight") != std::string::npos) std::fill_n(p, t.size, 1.0f);
      continue;
    }
    const bool embed = t.name == "encoder.embed.weight";
    const double inputs = static_cast<double>(t.shape[embed ? 1 : 0]);
    double deviation = std::sqrt(2.0 / inputs);
    if (t.name == "mlp.3.weight" || t.name == "head.force.weight") deviation *= 0.05;  // first predictions near zero
    for (std::size_t i = 0; i < t.size; ++i) p[i] = static_cast<float>(normal(rng, deviation));
    if (t.name.find("edge") != std::string::npos) {  // W_self = W1 - W2
      const auto columns = static_cast<std::size_t>(t.shape[1]);
      for (std::size_t i = 0; i < t.size; i += columns)
        for (std::size_t j = 0; j < columns / 2; ++j) p[i + j] -= p[i + columns / 2 + j];
    }
  }
  return parameters;
}

void FastNetwork::set_parameters(const std::vector<float>& parameters) {
  if (parameters.size() != parameter_count()) throw std::invalid_argument("wrong number of parameters");
  Impl& m = *impl_;
  m.parameters = parameters;
  m.encoder->set_parameters(m.parameters.data());
  for (Linear& layer : m.mlp) {
    const int columns = m.padded(layer.wanted);
    layer.transposed.assign(area(layer.out, columns), 0.0f);
    const float* w = m.parameters.data() + layer.weight;
    for (int i = 0; i < layer.wanted; ++i)
      for (int j = 0; j < layer.out; ++j) layer.transposed[area(j, columns) + i] = w[area(i, layer.out) + j];
  }
  if (m.head) {
    m.head->set_parameters(m.parameters.data());
    const int H = m.config.point_head, G = m.config.hidden;
    m.head_scene_transposed.resize(area(H, G));
    for (int i = 0; i < G; ++i)
      for (int j = 0; j < H; ++j) m.head_scene_transposed[area(j, G) + i] = m.parameters[m.head_scene + area(i, H) + j];
  }
  const Linear& last = m.mlp[2];
  const int columns = m.padded(last.out);
  m.last_weight.assign(area(last.in, columns), 0.0f);
  for (int i = 0; i < last.in; ++i)
    std::copy_n(m.parameters.data() + last.weight + area(i, last.out), last.out,
                m.last_weight.data() + area(i, columns));
}

std::vector<float> FastNetwork::predict(const NetworkInput& input) const {
  const Impl& m = *impl_;
  m.check_input(input);
  auto workspace = m.borrow();
  m.forward(input, *workspace, false);
  std::vector<float> output(area(input.batch, 6));
  for (int b = 0; b < input.batch; ++b)
    std::copy_n(workspace->output.data() + area(b, m.padded(6)), 6, output.data() + area(b, 6));
  m.give_back(std::move(workspace));
  return output;
}

std::vector<float> FastNetwork::gradient(const NetworkInput& input, const std::vector<float>& target,
                                         std::vector<float>& gradient) {
  Impl& m = *impl_;
  m.check_input(input);
  const int batch = input.batch, width = m.padded(6);
  if (target.size() != area(batch, 6) || gradient.size() != parameter_count())
    throw std::invalid_argument("target or gradient has the wrong size");
  auto workspace = m.borrow();
  Impl::Workspace& w = *workspace;
  m.forward(input, w, true);

  std::vector<float> losses(batch);
  w.d_output.assign(area(batch, width), 0.0f);
  for (int b = 0; b < batch; ++b) {
    double loss = 0.0;
    for (int i = 0; i < 6; ++i) {
      const float error = w.output[area(b, width) + i] - target[area(b, 6) + i];
      loss += error * error / 6.0;
      w.d_output[area(b, width) + i] = error / 3.0f;
    }
    losses[b] = static_cast<float>(loss);
  }

  m.backward(input, w, gradient.data());
  const int pooled = m.padded(m.encoder->pooled());
  for (int b = 0; b < batch; ++b) {
    float* d_features = m.encoder->start_backward(w.saved[b], input.points, w.d_input.data() + area(b, pooled),
                                                  w.scratch, gradient.data());
    if (m.head) m.head->add_feature_gradient(w.head_saved[b], d_features);
    m.encoder->backward(w.saved[b], input.points, w.scratch, gradient.data());
  }
  m.give_back(std::move(workspace));
  return losses;
}

}  // namespace dofusion
