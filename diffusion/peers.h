// Several processes, on one machine or more, that train one model together.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace dofusion {

class Peers {
 public:
  virtual ~Peers() = default;
  virtual int rank() const = 0;   // 0 … count() - 1
  virtual int count() const = 0;  // of processes
  // Replaces every value by its sum over all processes; all must call it with as many values. Every process gets the
  // same bits. Throws std::runtime_error if another one is gone.
  virtual void sum(std::vector<float>& values) = 0;
};

// Meets the others through libtorch's c10d and Gloo; in diffusion_torch. `rendezvous`: "host:port" of rank 0, which
// listens there. Waits up to five minutes for the others. Throws std::invalid_argument if rank, count or rendezvous
// make no sense, std::runtime_error if they do not meet.
std::unique_ptr<Peers> meet_peers(int rank, int count, const std::string& rendezvous);

}  // namespace dofusion
