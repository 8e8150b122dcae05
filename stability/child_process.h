// Work on a user's file in a safe place: libraries that read files may crash on them, never return, take all memory or
// end the process. Private to stability.
#pragma once

#include <functional>
#include <string>

namespace dofusion {

struct ChildResult {
  enum class End { kReturned, kOutOfTime, kCrashed } end = End::kCrashed;
  int status = 0;      // what the work returned
  std::string output;  // what it wrote
};

// Has a forked child run `work(pipe)`, which writes its output to the pipe's file number, within so many seconds of
// processor time and 8 GB. Its standard streams lead nowhere; signals have their default effect. Throws
// std::runtime_error if there can be no child.
ChildResult run_in_child(const std::function<int(int pipe)>& work, unsigned cpu_seconds);

}  // namespace dofusion
