#include "diffusion/point_head.h"

#include <algorithm>

#include "diffusion/augmented_cloud.h"

namespace dofusion {
namespace {

constexpr int kForceColumns = 16;  // products need a multiple of 16; three are used

std::size_t area(std::size_t rows, std::size_t columns) { return rows * columns; }

}  // namespace

PointHead::PointHead(const ModelConfig& config, const kernels::Kernels& kernels, int channels, const Offsets& offsets)
    : kernels_(kernels),
      channels_(channels),
      hidden_(config.point_head),
      use_pose_(config.use_pose),
      offsets_(offsets) {}

void PointHead::set_parameters(const float* parameters) {
  const float* local = parameters + offsets_.local;
  packed_.resize(area(channels_, hidden_) / 2);
  kernels_.pack_bf16(channels_, hidden_, local, hidden_, packed_.data());
  std::vector<float> transposed(area(channels_, hidden_));
  for (int i = 0; i < channels_; ++i)
    for (int j = 0; j < hidden_; ++j) transposed[area(j, channels_) + i] = local[area(i, hidden_) + j];
  packed_transposed_.resize(area(channels_, hidden_) / 2);
  kernels_.pack_bf16(hidden_, channels_, transposed.data(), channels_, packed_transposed_.data());
  const float* force = parameters + offsets_.force;
  force_.assign(area(hidden_, kForceColumns), 0.0f);
  force_transposed_.resize(area(3, hidden_));
  for (int j = 0; j < hidden_; ++j)
    for (int d = 0; d < 3; ++d) {
      force_[area(j, kForceColumns) + d] = force[area(j, 3) + d];
      force_transposed_[area(d, hidden_) + j] = force[area(j, 3) + d];
    }
}

void PointHead::forward(const float* cloud, int points, float origin_z, const std::uint16_t* features,
                        const float* scene_term, Saved& saved, Scratch& scratch, float* output) const {
  saved.points.clear();
  for (int p = 0; p < points; ++p)
    if (cloud[area(p, kCloudChannels) + 4] == 1.0f) saved.points.push_back(p);
  const int n = static_cast<int>(saved.points.size()), even = n + n % 2;
  if (n == 0) return;
  if (!use_pose_) {  // the height of the query's origin is part of its pose
    origin_z = 0.0f;
    for (const int p : saved.points) origin_z += cloud[area(p, kCloudChannels) + 2] / static_cast<float>(n);
  }
  saved.arms.resize(area(n, 3));
  saved.local.assign(area(even, channels_), 0);
  for (int i = 0; i < n; ++i) {
    const float* point = cloud + area(saved.points[i], kCloudChannels);
    saved.arms[area(i, 3)] = point[0];
    saved.arms[area(i, 3) + 1] = point[1];
    saved.arms[area(i, 3) + 2] = point[2] - origin_z;
    std::copy_n(features + area(saved.points[i], channels_), channels_, saved.local.data() + area(i, channels_));
  }
  saved.hidden.resize(area(even, hidden_));
  for (int i = 0; i < even; ++i) std::copy_n(scene_term, hidden_, saved.hidden.data() + area(i, hidden_));
  kernels_.matmul_bf16(even, hidden_, channels_ / 2, reinterpret_cast<const std::uint32_t*>(saved.local.data()),
                       channels_ / 2, 1, packed_.data(), saved.hidden.data(), hidden_, true);
  for (float& v : saved.hidden) v = v > 0 ? v : kernels::kLeakySlope * v;
  std::fill(saved.hidden.begin() + static_cast<std::ptrdiff_t>(area(n, hidden_)), saved.hidden.end(), 0.0f);

  scratch.forces.resize(area(even, kForceColumns));
  kernels_.matmul_f32(even, kForceColumns, hidden_, saved.hidden.data(), hidden_, 1, force_.data(), kForceColumns,
                      scratch.forces.data(), kForceColumns, false);
  float sum[6] = {};
  for (int i = 0; i < n; ++i) {
    const float* f = scratch.forces.data() + area(i, kForceColumns);
    const float* r = saved.arms.data() + area(i, 3);
    for (int d = 0; d < 3; ++d) {
      const int e = (d + 1) % 3, g = (d + 2) % 3;
      sum[d] += f[d];
      sum[3 + d] += r[e] * f[g] - r[g] * f[e];
    }
  }
  for (int d = 0; d < 6; ++d) output[d] += sum[d] / static_cast<float>(n);
}

void PointHead::backward(Saved& saved, const float* d_output, Scratch& scratch, float* gradient,
                         float* d_scene_term) const {
  const int n = static_cast<int>(saved.points.size()), even = n + n % 2;
  if (n == 0) return;
  const float share = 1.0f / static_cast<float>(n);
  scratch.d_hidden.assign(area(even, hidden_), 0.0f);
  float* d_force = gradient + offsets_.force;
  for (int i = 0; i < n; ++i) {
    // Of a . (r x f) with respect to f: a x r.
    const float* r = saved.arms.data() + area(i, 3);
    const float* h = saved.hidden.data() + area(i, hidden_);
    float* d_h = scratch.d_hidden.data() + area(i, hidden_);
    float d_f[3];
    for (int d = 0; d < 3; ++d) {
      const int e = (d + 1) % 3, g = (d + 2) % 3;
      d_f[d] = share * (d_output[d] + d_output[3 + e] * r[g] - d_output[3 + g] * r[e]);
    }
    const float *w0 = force_transposed_.data(), *w1 = w0 + hidden_, *w2 = w1 + hidden_;
    for (int j = 0; j < hidden_; ++j) {
      const float d = d_f[0] * w0[j] + d_f[1] * w1[j] + d_f[2] * w2[j];
      d_h[j] = h[j] > 0 ? d : kernels::kLeakySlope * d;
      d_scene_term[j] += d_h[j];
    }
    for (int j = 0; j < hidden_; ++j)
      for (int d = 0; d < 3; ++d) d_force[area(j, 3) + d] += h[j] * d_f[d];
  }
  float* d_bias = gradient + offsets_.bias;
  for (int i = 0; i < n; ++i) kernels_.axpy(hidden_, 1.0f, scratch.d_hidden.data() + area(i, hidden_), d_bias);

  scratch.d_packed.resize(area(even, hidden_) / 2);
  scratch.pairs.resize(area(even, channels_) / 2);
  kernels_.pack_bf16(even, hidden_, scratch.d_hidden.data(), hidden_, scratch.d_packed.data());
  kernels_.pair_rows(even, channels_, saved.local.data(), channels_, scratch.pairs.data());
  kernels_.matmul_bf16(channels_, hidden_, even / 2, scratch.pairs.data(), 1, channels_, scratch.d_packed.data(),
                       gradient + offsets_.local, hidden_, true);

  scratch.d_rounded.resize(area(even, hidden_));
  kernels_.round_bf16(even, hidden_, scratch.d_hidden.data(), hidden_, scratch.d_rounded.data(), hidden_);
  saved.d_local.resize(area(even, channels_));
  kernels_.matmul_bf16(even, channels_, hidden_ / 2, reinterpret_cast<const std::uint32_t*>(scratch.d_rounded.data()),
                       hidden_ / 2, 1, packed_transposed_.data(), saved.d_local.data(), channels_, false);
}

void PointHead::add_feature_gradient(const Saved& saved, float* d_features) const {
  for (std::size_t i = 0; i < saved.points.size(); ++i)
    kernels_.axpy(channels_, 1.0f, saved.d_local.data() + area(i, channels_),
                  d_features + area(saved.points[i], channels_));
}

}  // namespace dofusion
