#include "apps/program.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include "stability/files.h"

namespace dofusion {
namespace {

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

int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& body) {
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  app.set_version_flag("--version", "dofusion 0.1.0");
  app.get_formatter()->column_width(34);
  const std::string name = app.get_name();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help, --version
    std::fprintf(stderr, "%s: %s; see %s --help\n", name.c_str(), first_line(e.what()).c_str(), name.c_str());
    return 2;
  }
  try {
    body();
    return 0;
  } catch (const InputError& e) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), first_line(e.what()).c_str());
    return 2;
  } catch (const std::invalid_argument& e) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), first_line(e.what()).c_str());
    return 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), first_line(e.what()).c_str());
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
  if (terminal_) std::fprintf(stderr, "\n");
}

void Progress::update(std::int64_t done, const std::string& note) {
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

int default_threads() { return static_cast<int>(std::max(1u, std::thread::hardware_concurrency())); }

void parallel_for(std::int64_t count, int threads, const std::function<void(std::int64_t, int)>& body) {
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
  for (int t = 1; t < useful; ++t) pool.emplace_back(work, t);
  work(0);
  for (std::thread& thread : pool) thread.join();
  if (error) std::rethrow_exception(error);
}

}  // namespace dofusion
