// Networks built of plain libtorch operations: the paper's, and the default preset's as a reference for the fast one.
#pragma once

#include <memory>

#include "diffusion/network.h"

namespace dofusion {

// Makes make_network() serve the paper's preset. `threads`: for libtorch, which starts with one.
void enable_torch_networks(int threads);

// The paper's network. DGCNN: four edge convolutions with dynamic graphs, the first on position and flag, the others on
// the features before them; each an edge-wise linear map of [x_i, x_j - x_i], batch norm, leaky ReLU, maximum over the
// k neighbours; concatenation, linear map to `embedding` channels, batch norm, leaky ReLU, maximum over the points.
// Then a three-layer MLP with ReLU on latent, noisy pose and t (the noise scale's place in the schedule, 0 to 1), which
// predicts the noise in units of its scale. The paper does not say widths: DGCNN's own.
std::unique_ptr<Network> make_paper_network(const ModelConfig& config);

// The default preset's network in float32 (or float64) operations of libtorch, with FastNetwork's parameters.
std::unique_ptr<Network> make_reference_network(const ModelConfig& config, bool float64 = false);

}  // namespace dofusion
