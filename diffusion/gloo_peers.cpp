#include <chrono>
#include <stdexcept>

#include "diffusion/peers.h"

// Some distributions of libtorch come without Gloo's headers.
#if defined(USE_C10D_GLOO) && __has_include(<gloo/rendezvous/store.h>)
#define DOFUSION_GLOO
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#include <torch/csrc/distributed/c10d/TCPStore.hpp>
#include <torch/torch.h>
#endif

namespace dofusion {

#ifdef DOFUSION_GLOO
namespace {

constexpr std::chrono::minutes kPatience{5};

class GlooPeers : public Peers {
 public:
  GlooPeers(int rank, int count, const std::string& host, int port) : rank_(rank), count_(count) {
    c10d::TCPStoreOptions store_options;
    store_options.port = static_cast<std::uint16_t>(port);
    store_options.isServer = rank == 0;
    store_options.numWorkers = count;
    store_options.timeout = std::chrono::duration_cast<std::chrono::milliseconds>(kPatience);
    auto store = c10::make_intrusive<c10d::TCPStore>(host, store_options);
    auto options = c10d::ProcessGroupGloo::Options::create();
    options->devices.push_back(c10d::ProcessGroupGloo::createDefaultDevice());
    options->timeout = std::chrono::duration_cast<std::chrono::milliseconds>(kPatience);
    group_ = c10::make_intrusive<c10d::ProcessGroupGloo>(store, rank, count, options);
  }

  int rank() const override { return rank_; }
  int count() const override { return count_; }

  void sum(std::vector<float>& values) override {
    std::vector<at::Tensor> tensors = {
        torch::from_blob(values.data(), {static_cast<std::int64_t>(values.size())}, torch::kFloat32)};
    try {
      group_->allreduce(tensors)->wait();
    } catch (const std::exception& error) {
      const std::string text = error.what();
      throw std::runtime_error("another process of this training is gone: " + text.substr(0, text.find('\n')));
    }
  }

 private:
  int rank_, count_;
  c10::intrusive_ptr<c10d::ProcessGroupGloo> group_;
};

}  // namespace
#endif

std::unique_ptr<Peers> meet_peers(int rank, int count, const std::string& rendezvous) {
  if (count < 1 || rank < 0 || rank >= count)
    throw std::invalid_argument("--rank must be from 0 to one less than --world-size, not " + std::to_string(rank) +
                                " of " + std::to_string(count));
  const std::size_t colon = rendezvous.rfind(':');
  int port = 0;
  try {
    port = colon == std::string::npos ? 0 : std::stoi(rendezvous.substr(colon + 1));
  } catch (const std::exception&) {
    port = 0;
  }
  if (colon == 0 || port < 1 || port > 65535)
    throw std::invalid_argument("--rendezvous: expected HOST:PORT of rank 0, not '" + rendezvous + "'");
#ifdef DOFUSION_GLOO
  try {
    return std::make_unique<GlooPeers>(rank, count, rendezvous.substr(0, colon), port);
  } catch (const std::exception& error) {
    const std::string text = error.what();
    throw std::runtime_error(rendezvous + ": the processes did not meet: " + text.substr(0, text.find('\n')));
  }
#else
  throw std::runtime_error(rendezvous + ": this program was built without Gloo, which joins processes");
#endif
}

}  // namespace dofusion
