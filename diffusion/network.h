// What trainer and sampler need of a network: parameters in one flat array, predictions and gradients of batches.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "diffusion/augmented_cloud.h"  // kCloudChannels
#include "diffusion/config.h"

namespace dofusion {

// A named tensor inside the flat parameter array, row-major.
struct TensorInfo {
  std::string name;
  std::vector<std::int64_t> shape;
  std::size_t offset = 0;  // floats from the array's start
  std::size_t size = 0;    // floats
  bool trained = true;     // false: state such as a batch norm's running mean
  bool decays = true;      // weight decay applies (matrices)
};

// B scenes of P points each. All lengths normalised, angles in radians.
struct NetworkInput {
  int batch = 0;             // B
  int points = 0;            // P, even
  std::vector<float> cloud;  // (B, P, kCloudChannels), as make_augmented_cloud fills it
  std::vector<float> pose;   // (B, pose_features)
  std::vector<float> sigma;  // (B): noise scale
};

// Not safe for concurrent use unless said; training uses gradient() with several threads inside.
class Network {
 public:
  virtual ~Network() = default;

  virtual const std::vector<TensorInfo>& tensors() const = 0;
  std::size_t parameter_count() const;

  // Fresh parameters, drawn from `seed`.
  virtual std::vector<float> initial_parameters(std::uint64_t seed) const = 0;

  // Must be called whenever the parameters changed, before predict or gradient.
  virtual void set_parameters(const std::vector<float>& parameters) = 0;

  // The state inside (batch norm's running means) after gradient(), written into the flat array.
  virtual void get_state(std::vector<float>& parameters) const { (void)parameters; }

  // Output (B, 6). Rows do not depend on what else is in the batch. Safe for concurrent use.
  virtual std::vector<float> predict(const NetworkInput& input) const = 0;

  // Adds the gradient of the sum over the batch of the mean squared error per scene to `gradient` (flat, as the
  // parameters); returns that error per scene, (B). `target`: (B, 6). Networks whose scenes are independent allow
  // concurrent calls (with different `gradient`).
  virtual std::vector<float> gradient(const NetworkInput& input, const std::vector<float>& target,
                                      std::vector<float>& gradient) = 0;

  // Scenes in a batch do not influence each other's gradient, so a batch may be split among threads.
  virtual bool scenes_are_independent() const = 0;
};

// The network of `config`. The paper's needs libtorch: throws std::runtime_error if the program did not call
// enable_torch_networks() (torch_network.h).
std::unique_ptr<Network> make_network(const ModelConfig& config);

using NetworkFactory = std::unique_ptr<Network> (*)(const ModelConfig&);
void register_paper_network(NetworkFactory factory);

}  // namespace dofusion
