// The part of fast_network.h that lets every point of the query pull: forces on the points, whose mean moves the query
// and whose mean moment about the query's origin turns it.
#pragma once

#include <cstdint>
#include <vector>

#include "diffusion/config.h"
#include "diffusion/kernels.h"

namespace dofusion {

// Letters: n points of the query, S channels of a point's features, H hidden channels of the head, G of the scene.
//
//   h_i = leaky(W_local x_i + W_scene g + b),  f_i = W_force h_i
//   translation += mean_i f_i,  rotation += mean_i r_i x f_i   (r_i: the point about the query's origin)
class PointHead {
 public:
  struct Offsets {
    std::size_t local = 0;  // (S, H)
    std::size_t bias = 0;   // (H)
    std::size_t force = 0;  // (H, 3)
  };

  // `channels`: S. config.point_head: H, a multiple of 32.
  PointHead(const ModelConfig& config, const kernels::Kernels& kernels, int channels, const Offsets& offsets);

  void set_parameters(const float* parameters);

  // What the backward pass needs of one scene's forward pass. Rows beyond n are zero, to make their number even.
  struct Saved {
    std::vector<int> points;           // (n): which of the cloud's
    std::vector<float> arms;           // (n, 3): r_i
    std::vector<std::uint16_t> local;  // (n even, S) bf16
    std::vector<float> hidden;         // (n even, H) after the activation
    std::vector<float> d_local;        // (n even, S), of backward()
  };
  struct Scratch {
    std::vector<float> forces;    // (n even, 16), three columns used
    std::vector<float> d_hidden;  // (n even, H)
    std::vector<std::uint16_t> d_rounded;
    std::vector<std::uint32_t> d_packed, pairs;
  };

  // features (P, S) bf16 of the cloud (P, kCloudChannels); scene_term (H): W_scene g + b. Adds to output (6).
  void forward(const float* cloud, int points, float origin_z, const std::uint16_t* features, const float* scene_term,
               Saved& saved, Scratch& scratch, float* output) const;

  // d_output (6) -> adds to the gradient of the parameters (all but W_scene) and to d_scene_term (H).
  void backward(Saved& saved, const float* d_output, Scratch& scratch, float* gradient, float* d_scene_term) const;
  // After it: adds to d_features (P, S).
  void add_feature_gradient(const Saved& saved, float* d_features) const;

 private:
  const kernels::Kernels& kernels_;
  int channels_, hidden_;
  bool use_pose_;
  Offsets offsets_;
  std::vector<std::uint32_t> packed_;             // (S, H)
  std::vector<std::uint32_t> packed_transposed_;  // (H, S)
  std::vector<float> force_;                      // (H, 16): filled up with zeros
  std::vector<float> force_transposed_;           // (3, H)
};

}  // namespace dofusion
