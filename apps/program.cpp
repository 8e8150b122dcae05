#include "apps/program.h"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "stability/files.h"

namespace dofusion {
namespace {

enum class Verbosity { kQuiet, kNormal, kVerbose };
Verbosity verbosity = Verbosity::kNormal;  // set once, before the work begins

volatile std::sig_atomic_t stop_requested = 0;
// The second one ends the program at once.
extern "C" void request_stop(int signal_number) {
  stop_requested = 1;
  std::signal(signal_number, SIG_DFL);
}

std::string first_line(const char* text) {
  std::string line = text;
  for (char& c : line) {
    if (c == '\n') c = ' ';
  }
  return line;
}

std::string duration(double seconds) {
  const auto s = static_cast<std::int64_t>(seconds);
  char text[32];
  if (s >= 3600) {
    std::snprintf(text, sizeof text, "%ldh%02ldm", static_cast<long>(s / 3600), static_cast<long>(s / 60 % 60));
  } else {
    std::snprintf(text, sizeof text, "%ldm%02lds", static_cast<long>(s / 60), static_cast<long>(s % 60));
  }
  return text;
}

}  // namespace

bool interrupted() { return stop_requested != 0; }

void summary(const std::string& text) {
  if (verbosity != Verbosity::kQuiet) std::fputs(text.c_str(), stdout);
}

void note(const std::string& line) {
  if (verbosity != Verbosity::kQuiet) std::fprintf(stderr, "%s\n", line.c_str());
}

void detail(const std::string& line) {
  if (verbosity == Verbosity::kVerbose) note(line);
}

int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& body, bool speaks) {
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  std::signal(SIGXFSZ, SIG_IGN);  // a file over the user's limit is a write that fails, with its line
  app.set_version_flag("--version", "dofusion 0.1.0");
  bool quiet = false, verbose = false;
  CLI::Option* quiet_flag = app.add_flag("-q,--quiet", quiet, "say nothing but errors");
  app.add_flag("-v,--verbose", verbose, "say what is done, step by step")->excludes(quiet_flag);
  app.get_formatter()->column_width(34);
  const std::string name = app.get_name();
  const auto say = [&](const std::string& line) {
    if (speaks) std::fprintf(stderr, "%s: %s\n", name.c_str(), line.c_str());
  };
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return speaks ? app.exit(e) : 0;  // --help, --version
    say(first_line(e.what()) + "; see " + name + " --help");
    return 2;
  }
  verbosity = quiet ? Verbosity::kQuiet : verbose ? Verbosity::kVerbose : Verbosity::kNormal;
  try {
    body();
    return 0;
  } catch (const InputError& e) {
    say(first_line(e.what()));
    return 2;
  } catch (const std::invalid_argument& e) {
    say(first_line(e.what()));
    return 2;
  } catch (const std::exception& e) {
    say(first_line(e.what()));
    return 1;
  }
}

Progress::Progress(std::string what, std::int64_t total, std::int64_t done)
    : what_(std::move(what)),
      total_(total),
      first_(done),
      terminal_(::isatty(STDERR_FILENO) == 1),
      begin_(Clock::now()),
      last_(begin_) {}

Progress::~Progress() {
  if (terminal_ && verbosity != Verbosity::kQuiet) std::fprintf(stderr, "\n");
}

void Progress::update(std::int64_t done, const std::string& note) {
  if (verbosity == Verbosity::kQuiet) return;
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  const Clock::time_point now = Clock::now();
  const auto since_last = std::chrono::duration<double>(now - last_).count();
  if (done < total_ && since_last < (terminal_ ? 0.2 : 10.0)) return;
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - begin_).count();
  const double rate = seconds > 0.0 ? static_cast<double>(done - first_) / seconds : 0.0;
  const double left = rate > 0.0 ? static_cast<double>(total_ - done) / rate : 0.0;
  std::fprintf(stderr, "%s%s: %ld/%ld (%.1f/s, %s left)%s%s%s", terminal_ ? "\r" : "", what_.c_str(),
               static_cast<long>(done), static_cast<long>(total_), rate, duration(left).c_str(),
               note.empty() ? "" : "  ", note.c_str(), terminal_ ? "\033[K" : "\n");
  std::fflush(stderr);
}

int default_threads() {
  cpu_set_t allowed;
  if (::sched_getaffinity(0, sizeof allowed, &allowed) == 0) return CPU_COUNT(&allowed);
  return static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

}  // namespace dofusion
