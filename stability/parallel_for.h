// Shares a loop among threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace dofusion {

// Calls body(index, thread) for every index in [0, count) on `threads` threads, each index taken by whichever thread
// is free: what is done for an index must not depend on `thread`, which is there for scratch memory. The first
// exception stops all and is thrown again.
template <class Body>
void parallel_for(std::int64_t count, int threads, const Body& body) {
  std::atomic<std::int64_t> next{0};
  std::exception_ptr error;
  std::mutex error_mutex;
  const auto work = [&](int thread) {
    try {
      for (std::int64_t i = next++; i < count; i = next++) body(i, thread);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(error_mutex);
      if (!error) error = std::current_exception();
      next = count;
    }
  };
  std::vector<std::thread> pool;
  const int useful = static_cast<int>(std::min<std::int64_t>(threads, count));
  for (int thread = 1; thread < useful; ++thread) pool.emplace_back(work, thread);
  work(0);
  for (std::thread& thread : pool) thread.join();
  if (error) std::rethrow_exception(error);
}

}  // namespace dofusion
