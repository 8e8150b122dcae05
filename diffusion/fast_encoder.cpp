#include "diffusion/fast_encoder.h"

#include <algorithm>
#include <cmath>

#include "diffusion/fast_network.h"

namespace dofusion {
namespace {

// (rows, columns) -> (columns, rows)
std::vector<float> transposed(const float* x, int rows, int columns) {
  std::vector<float> out(static_cast<std::size_t>(rows) * columns);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j)
      out[static_cast<std::size_t>(j) * rows + i] = x[static_cast<std::size_t>(i) * columns + j];
  return out;
}

std::size_t area(int rows, int columns) { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns); }

}  // namespace

FastEncoder::FastEncoder(const ModelConfig& config, const kernels::Kernels& kernels, std::vector<LayerOffsets> layers,
                         std::size_t embed_weight, std::size_t embed_gamma, std::size_t embed_beta)
    : config_(config),
      kernels_(kernels),
      features_(config.point_features()),
      channels_(0),
      embedding_(config.embedding),
      embed_weight_(embed_weight),
      embed_gamma_(embed_gamma),
      embed_beta_(embed_beta) {
  int in = features_;
  for (std::size_t l = 0; l < layers.size(); ++l) {
    layers_.push_back({in, config.widths[l], channels_, layers[l], {}, {}});
    in = config.widths[l];
    channels_ += in;
  }
}

void FastEncoder::set_parameters(const float* parameters) {
  parameters_ = parameters;
  for (std::size_t l = 1; l < layers_.size(); ++l) {
    Layer& layer = layers_[l];
    const float* weight = parameters + layer.offsets.weight;
    layer.packed.resize(area(layer.in, layer.out));
    kernels_.pack_bf16(layer.in, 2 * layer.out, weight, 2 * layer.out, layer.packed.data());
    const auto turned = transposed(weight, layer.in, 2 * layer.out);
    layer.packed_transposed.resize(area(layer.in, layer.out));
    kernels_.pack_bf16(2 * layer.out, layer.in, turned.data(), layer.in, layer.packed_transposed.data());
  }
  embed_packed_.resize(area(channels_, embedding_) / 2);
  const auto turned = transposed(parameters + embed_weight_, embedding_, channels_);
  kernels_.pack_bf16(channels_, embedding_, turned.data(), embedding_, embed_packed_.data());
}

void FastEncoder::forward(const float* cloud, int points, float sigma, Saved& saved, Scratch& scratch,
                          float* pooled) const {
  const int k = config_.neighbours;
  const int padded = (points + 15) / 16 * 16;
  saved.features.resize(area(points, features_));
  point_features(config_, cloud, points, sigma, saved.features.data(), features_);

  scratch.coordinates.assign(area(4, padded), 0.0f);
  scratch.keys.resize(padded);
  const float* coordinates[4];
  for (int d = 0; d < 4; ++d) {
    float* out = scratch.coordinates.data() + area(d, padded);
    for (int i = 0; i < points; ++i) out[i] = cloud[kCloudChannels * i + (d < 3 ? d : 4)];
    coordinates[d] = out;
  }
  saved.neighbours.resize(area(points, k));
  kernels_.nearest(points, k, coordinates, saved.neighbours.data(), scratch.keys.data());

  saved.concatenated.resize(area(points, channels_));
  saved.normalised.resize(layers_.size());
  saved.deviation.resize(layers_.size());
  saved.slot.resize(layers_.size());
  for (std::size_t l = 0; l < layers_.size(); ++l) {
    const Layer& layer = layers_[l];
    const int columns = 2 * layer.out;
    scratch.products.resize(std::max(scratch.products.size(), area(points, columns)));
    if (l == 0) {
      kernels_.matmul_f32(points, columns, features_, saved.features.data(), features_, 1,
                          parameters_ + layer.offsets.weight, columns, scratch.products.data(), columns, false);
    } else {
      const auto* x = reinterpret_cast<const std::uint32_t*>(saved.concatenated.data() + layers_[l - 1].start);
      kernels_.matmul_bf16(points, columns, layer.in / 2, x, channels_ / 2, 1, layer.packed.data(),
                           scratch.products.data(), columns, false);
    }
    saved.normalised[l].resize(area(points, layer.out));
    saved.deviation[l].resize(points);
    saved.slot[l].resize(area(points, layer.out));
    kernels_.edge_forward(points, layer.out, k, scratch.products.data(), saved.neighbours.data(),
                          parameters_ + layer.offsets.gamma, parameters_ + layer.offsets.beta,
                          saved.concatenated.data() + layer.start, channels_, saved.normalised[l].data(),
                          saved.deviation[l].data(), saved.slot[l].data());
  }

  scratch.products.resize(std::max(scratch.products.size(), area(points, embedding_)));
  scratch.maximum.resize(embedding_);
  saved.embed_row.resize(embedding_);
  saved.embed_normalised.resize(embedding_);
  kernels_.matmul_bf16(points, embedding_, channels_ / 2,
                       reinterpret_cast<const std::uint32_t*>(saved.concatenated.data()), channels_ / 2, 1,
                       embed_packed_.data(), scratch.products.data(), embedding_, false);
  kernels_.column_max(points, embedding_, scratch.products.data(), scratch.maximum.data(), saved.embed_row.data());
  double mean = 0.0, variance = 0.0;
  for (const float v : scratch.maximum) mean += v;
  mean /= embedding_;
  for (const float v : scratch.maximum) variance += (v - mean) * (v - mean);
  saved.embed_deviation = static_cast<float>(1.0 / std::sqrt(variance / embedding_ + 1e-5));
  for (int j = 0; j < embedding_; ++j) {
    const float x = (scratch.maximum[j] - static_cast<float>(mean)) * saved.embed_deviation;
    saved.embed_normalised[j] = x;
    const float z = parameters_[embed_gamma_ + j] * x + parameters_[embed_beta_ + j];
    pooled[j] = z > 0 ? z : kernels::kLeakySlope * z;
  }
  kernels_.column_sum_bf16(points, channels_, saved.concatenated.data(), channels_, 1.0f / static_cast<float>(points),
                           pooled + embedding_);
}

float* FastEncoder::start_backward(const Saved& saved, int points, const float* d_pooled, Scratch& scratch,
                                   float* gradient) const {
  // Mean pool: every point gets the same share.
  scratch.d_concatenated.resize(area(points, channels_));
  float* d_x = scratch.d_concatenated.data();
  for (int j = 0; j < channels_; ++j) d_x[j] = d_pooled[embedding_ + j] / static_cast<float>(points);
  for (int i = 1; i < points; ++i) std::copy(d_x, d_x + channels_, d_x + area(i, channels_));

  // Embedding: only the point that held each maximum.
  double mean = 0.0, along = 0.0;
  std::vector<float> d_maximum(embedding_);
  for (int j = 0; j < embedding_; ++j) {
    const float x = saved.embed_normalised[j], gamma = parameters_[embed_gamma_ + j];
    const float z = gamma * x + parameters_[embed_beta_ + j];
    const float d_z = z > 0 ? d_pooled[j] : kernels::kLeakySlope * d_pooled[j];
    gradient[embed_gamma_ + j] += d_z * x;
    gradient[embed_beta_ + j] += d_z;
    d_maximum[j] = d_z * gamma;
    mean += d_maximum[j];
    along += d_maximum[j] * x;
  }
  mean /= embedding_;
  along /= embedding_;
  for (int j = 0; j < embedding_; ++j) {
    const float d = saved.embed_deviation *
                    (d_maximum[j] - static_cast<float>(mean) - saved.embed_normalised[j] * static_cast<float>(along));
    const int row = saved.embed_row[j];
    kernels_.axpy(channels_, d, parameters_ + embed_weight_ + area(j, channels_), d_x + area(row, channels_));
    kernels_.axpy_bf16(channels_, d, saved.concatenated.data() + area(row, channels_),
                       gradient + embed_weight_ + area(j, channels_));
  }

  return d_x;
}

void FastEncoder::backward(const Saved& saved, int points, Scratch& scratch, float* gradient) const {
  const int k = config_.neighbours;
  float* d_x = scratch.d_concatenated.data();
  for (std::size_t l = layers_.size(); l-- > 0;) {
    const Layer& layer = layers_[l];
    const int columns = 2 * layer.out;
    scratch.d_products.resize(std::max(scratch.d_products.size(), area(points, columns)));
    float* d_products = scratch.d_products.data();
    kernels_.edge_backward(points, layer.out, k, d_x + layer.start, channels_, saved.neighbours.data(),
                           parameters_ + layer.offsets.gamma, parameters_ + layer.offsets.beta,
                           saved.normalised[l].data(), saved.deviation[l].data(), saved.slot[l].data(), d_products,
                           gradient + layer.offsets.gamma, gradient + layer.offsets.beta);
    if (l == 0) {
      kernels_.matmul_f32(features_, columns, points, saved.features.data(), 1, features_, d_products, columns,
                          gradient + layer.offsets.weight, columns, true);
      break;
    }
    const int before = layers_[l - 1].start;
    scratch.d_packed.resize(std::max(scratch.d_packed.size(), area(points, columns) / 2));
    scratch.x_pairs.resize(std::max(scratch.x_pairs.size(), area(points, layer.in) / 2));
    scratch.d_rounded.resize(std::max(scratch.d_rounded.size(), area(points, columns)));
    kernels_.pack_bf16(points, columns, d_products, columns, scratch.d_packed.data());
    kernels_.pair_rows(points, layer.in, saved.concatenated.data() + before, channels_, scratch.x_pairs.data());
    kernels_.matmul_bf16(layer.in, columns, points / 2, scratch.x_pairs.data(), 1, layer.in, scratch.d_packed.data(),
                         gradient + layer.offsets.weight, columns, true);
    kernels_.round_bf16(points, columns, d_products, columns, scratch.d_rounded.data(), columns);
    kernels_.matmul_bf16(points, layer.in, layer.out, reinterpret_cast<const std::uint32_t*>(scratch.d_rounded.data()),
                         layer.out, 1, layer.packed_transposed.data(), d_x + before, channels_, true);
  }
}

}  // namespace dofusion
