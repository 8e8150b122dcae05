// The `default` preset's network, forward and backward by hand, one scene at a time so that its tensors stay in the
// second-level cache.
//
//   cloud (P, 11) -> features (P, F) -> graph of k nearest points on position and flag
//   four edge convolutions: y_i = W_self x_i + max_j W_other x_j, layer norm, leaky ReLU; outputs concatenated (P, S)
//   pooled = [leaky(layer norm(max_i W_embed x_i)), mean_i x_i]   (E + S)
//   MLP on [pooled, noise features, pose features] -> hidden -> hidden -> 6, to which the forces on the query's points
//   are added (point_head.h), if the model has them
//
// The edge convolution is DGCNN's max_j W [x_i, x_j - x_i] with W_self = W1 - W2 and W_other = W2, exactly. Layer norm
// stands after the maximum, where DGCNN has a batch norm before it. Because nothing but the maximum follows W_embed
// per point, its gradient touches E entries instead of P x E.
// Products of the edge convolutions and of W_embed take bf16 operands and sum in float32; the first layer, whose
// inputs are coordinates, and the MLP are float32.
#pragma once

#include <memory>

#include "diffusion/network.h"

namespace dofusion {

namespace kernels {
struct Kernels;
}

class FastNetwork : public Network {
 public:
  // `kernels`: the version to use; nullptr for the fastest.
  explicit FastNetwork(const ModelConfig& config, const kernels::Kernels* kernels = nullptr);
  ~FastNetwork() override;

  const std::vector<TensorInfo>& tensors() const override;
  std::vector<float> initial_parameters(std::uint64_t seed) const override;
  void set_parameters(const std::vector<float>& parameters) override;
  std::vector<float> predict(const NetworkInput& input) const override;
  std::vector<float> gradient(const NetworkInput& input, const std::vector<float>& target,
                              std::vector<float>& gradient) override;
  bool scenes_are_independent() const override { return true; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Channels that the network derives of each point: x, y, z, SDF, flag, noise (log scale in [-1, 1]), then for each
// contact scale s: z / (|z| + s) and SDF / (|SDF| + s), then normal and direction of the distance if the model takes
// them. cloud: (points, kCloudChannels); features: (points, row), row >= F.
void point_features(const ModelConfig& config, const float* cloud, int points, float sigma, float* features, int row);

// log sigma scaled to [-1, 1] over the model's range, then sines and cosines of pi/2, pi, 3 pi/2, … times it.
// out: (1 + 2 noise_frequencies)
void noise_features(const ModelConfig& config, float sigma, float* out);

}  // namespace dofusion
