// The per-scene part of fast_network.h: points -> pooled features, and its gradient.
#pragma once

#include <cstdint>
#include <vector>

#include "diffusion/config.h"
#include "diffusion/kernels.h"

namespace dofusion {

// Letters: P points, k neighbours, F point features, C a layer's channels, S sum of all C, E embedding.

// The encoder's weights inside the flat parameter array (offsets) and packed for products.
class FastEncoder {
 public:
  struct LayerOffsets {
    std::size_t weight = 0;           // (C_in, 2 C): columns of W_self, then of W_other
    std::size_t gamma = 0, beta = 0;  // (C)
  };

  FastEncoder(const ModelConfig& config, const kernels::Kernels& kernels, std::vector<LayerOffsets> layers,
              std::size_t embed_weight, std::size_t embed_gamma, std::size_t embed_beta);

  void set_parameters(const float* parameters);

  int pooled() const { return embedding_ + channels_; }  // E + S
  int channels() const { return channels_; }             // S

  // What the backward pass needs of one scene's forward pass.
  struct Saved {
    std::vector<float> features;                  // (P, F)
    std::vector<std::uint16_t> neighbours;        // (P, k)
    std::vector<std::uint16_t> concatenated;      // (P, S) bf16
    std::vector<std::vector<float>> normalised;   // per layer (P, C)
    std::vector<std::vector<float>> deviation;    // per layer (P), inverse
    std::vector<std::vector<std::uint8_t>> slot;  // per layer (P, C)
    std::vector<std::int32_t> embed_row;          // (E)
    std::vector<float> embed_normalised;          // (E)
    float embed_deviation = 0.0f;                 // inverse
  };

  // Buffers that only live during a call; one per thread.
  struct Scratch {
    std::vector<float> products;           // (P, 2 C) or (P, E)
    std::vector<float> coordinates;        // (4, P padded)
    std::vector<std::int32_t> keys;        // (P padded)
    std::vector<float> maximum;            // (E)
    std::vector<float> d_concatenated;     // (P, S)
    std::vector<float> d_products;         // (P, 2 C)
    std::vector<std::uint16_t> d_rounded;  // (P, 2 C) bf16
    std::vector<std::uint32_t> d_packed, x_pairs;
  };

  // cloud (P, kCloudChannels) -> pooled (E + S).
  void forward(const float* cloud, int points, float sigma, Saved& saved, Scratch& scratch, float* pooled) const;

  // The gradient of the concatenated features (P, S), which backward() starts from, of the pooled ones (E + S).
  float* start_backward(const Saved& saved, int points, const float* d_pooled, Scratch& scratch, float* gradient) const;
  // From there to the parameters; both add to `gradient`, that of the flat parameters.
  void backward(const Saved& saved, int points, Scratch& scratch, float* gradient) const;

 private:
  struct Layer {
    int in = 0, out = 0, start = 0;  // channels; `start`: first column in the concatenation
    LayerOffsets offsets;
    std::vector<std::uint32_t> packed;             // (C_in, 2 C)
    std::vector<std::uint32_t> packed_transposed;  // (2 C, C_in)
  };

  const ModelConfig config_;
  const kernels::Kernels& kernels_;
  std::vector<Layer> layers_;
  int features_, channels_, embedding_;
  std::size_t embed_weight_;                 // (E, S): one row per output, as its gradient touches single rows
  std::size_t embed_gamma_, embed_beta_;     // (E)
  std::vector<std::uint32_t> embed_packed_;  // (S, E)
  const float* parameters_ = nullptr;
};

}  // namespace dofusion
