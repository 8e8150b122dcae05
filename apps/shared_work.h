// Many independent pieces of work, shared out among all threads of all ranks.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apps/ranks.h"

namespace dofusion {

// Does one item and returns its result as bytes. Called from several threads at once, each with its own `thread`, from
// 0 on, for scratch memory; the result must not depend on it.
using Work = std::function<std::string(std::int64_t item, int thread)>;

struct SharedWork {
  std::string job;                  // says to the other ranks what the work is
  std::vector<std::int64_t> items;  // begun in this order
  Work work;                        // does them on this rank
  std::function<void(std::int64_t item, const std::string& result)> collect;  // one call at a time, in any order
  int threads = 1;                                                            // of this rank
};

// On the first rank: does every item, here and on the ranks that serve, and collects the results here. Ranks get new
// items as they are done with old ones, so fast and slow machines go together. The first exception of any rank stops
// all and is thrown here; Interrupted if the user ends the program.
void share_work(Ranks& ranks, const SharedWork& shared);

// On every other rank: works for the first rank until that is done. `make_work` makes the work of the first rank's job;
// what it throws, or the work, is thrown on the first rank.
void serve(Ranks& ranks, int threads, const std::function<Work(const std::string& job)>& make_work);

}  // namespace dofusion
