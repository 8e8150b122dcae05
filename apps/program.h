// What all programs share: one place that turns errors into a line and an exit status, and progress on a terminal.
#pragma once

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace dofusion {

// Adds --version, --quiet and --verbose, and formats help; then parses, runs `body` and returns the exit status: 0 done, 2 bad arguments or
// bad input (InputError, std::invalid_argument), 1 anything else. Errors are one line on stderr, unless `speaks` is
// false, as it is for all but the first of the processes that share one job.
int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& body, bool speaks = true);

// What a program says besides errors; --quiet silences all of it, progress included. summary: the result, on stdout, as
// it is. note: a line on stderr. detail: a line on stderr with --verbose alone.
void summary(const std::string& text);
void note(const std::string& line);
void detail(const std::string& line);

// True once Ctrl-C (or a termination signal) has come; long loops look at it and leave complete files behind.
// run_program installs the handler.
bool interrupted();

// Thrown by loops that saw `interrupted()`: exit status 1 with its line.
class Interrupted : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

// "done/total (rate, time left)" on stderr: a line that rewrites itself on a terminal, a plain line every ten seconds
// elsewhere. `update` may be called from several threads.
class Progress {
 public:
  Progress(std::string what, std::int64_t total, std::int64_t done = 0);
  ~Progress();
  void update(std::int64_t done, const std::string& note = "");

 private:
  using Clock = std::chrono::steady_clock;
  std::string what_;
  std::int64_t total_, first_;
  bool terminal_;
  Clock::time_point begin_, last_;
};

// Default for --threads: the processors that this process may run on.
int default_threads();

}  // namespace dofusion
