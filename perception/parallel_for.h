// Shares a loop among threads.
#pragma once

#include <algorithm>
#include <exception>
#include <thread>
#include <vector>

namespace dofusion {

// Calls body(worker, i) for every i in [0, count); worker w takes i = w, w + threads, …, so that work of uneven cost
// spreads and results do not depend on timing. The first exception of a worker is thrown again here.
template <class Body>
void parallel_for(int count, int threads, const Body& body) {
  const int workers = std::max(1, std::min(threads, count));
  std::vector<std::exception_ptr> errors(workers);
  const auto work = [&](int worker) {
    try {
      for (int i = worker; i < count; i += workers) body(worker, i);
    } catch (...) {
      errors[worker] = std::current_exception();
    }
  };
  std::vector<std::thread> pool;
  for (int worker = 1; worker < workers; ++worker) pool.emplace_back(work, worker);
  work(0);
  for (std::thread& thread : pool) thread.join();
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace dofusion
