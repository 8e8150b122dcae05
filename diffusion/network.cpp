#include "diffusion/network.h"

#include <stdexcept>

#include "diffusion/fast_network.h"

namespace dofusion {
namespace {

NetworkFactory& paper_factory() {
  static NetworkFactory factory = nullptr;
  return factory;
}

}  // namespace

std::size_t Network::parameter_count() const {
  return tensors().empty() ? 0 : tensors().back().offset + tensors().back().size;
}

void register_paper_network(NetworkFactory factory) { paper_factory() = factory; }

std::unique_ptr<Network> make_network(const ModelConfig& config) {
  if (config.preset == Preset::kDefault) return std::make_unique<FastNetwork>(config);
  if (!paper_factory()) throw std::runtime_error("this program was built without the paper preset's network");
  return paper_factory()(config);
}

}  // namespace dofusion
