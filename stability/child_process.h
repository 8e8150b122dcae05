// Work on a user's file in a safe place: libraries that read files may crash on them, never return, take all memory or
// end the process.
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

// Processor time for a library that reads a file of so many bytes: far more than a good file takes.
inline unsigned reading_seconds(double file_bytes) { return static_cast<unsigned>(2.0 + file_bytes / 5e5); }

}  // namespace dofusion
