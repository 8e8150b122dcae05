#include "tests/apps/run_command.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "stability/files.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

constexpr rlim_t kProcessorSeconds = 600;

// In the child, where nothing but calls to the system is safe.
[[noreturn]] void execute(char* const* arguments, const char* out, const char* err, rlim_t most_file_bytes) {
  const rlimit limit{kProcessorSeconds, kProcessorSeconds};
  ::setrlimit(RLIMIT_CPU, &limit);
  const int in_file = ::open("/dev/null", O_RDONLY);
  const int out_file = ::open(out, O_CREAT | O_WRONLY, 0600), err_file = ::open(err, O_CREAT | O_WRONLY, 0600);
  if (::dup2(in_file, 0) < 0 || ::dup2(out_file, 1) < 0 || ::dup2(err_file, 2) < 0) ::_exit(126);
  const rlimit file_limit{most_file_bytes, most_file_bytes};
  if (most_file_bytes > 0) ::setrlimit(RLIMIT_FSIZE, &file_limit);
  ::execv(arguments[0], arguments);
  ::_exit(127);
}

// By the mask of caught signals that Linux shows of a process.
bool catches(pid_t process, int signal_number) {
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("SigCgt:", 0) == 0) return (std::stoull(line.substr(7), nullptr, 16) >> (signal_number - 1)) & 1u;
  }
  return true;  // it has ended
}

}  // namespace

RunningCommand::RunningCommand(std::vector<std::string> words, const CommandOptions& options)
    : directory_(std::make_unique<TemporaryDirectory>()) {
  const std::string out = *directory_ / "out", err = *directory_ / "err";
  if (words.at(0).find('/') == std::string::npos) words[0] = std::string(DOFUSION_BIN_DIR) + "/" + words[0];
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  child_ = ::fork();
  if (child_ < 0) throw std::runtime_error(std::string("fork: ") + std::strerror(errno));
  if (child_ == 0) {
    execute(pointers.data(), out.c_str(), err.c_str(), static_cast<rlim_t>(options.most_file_bytes));
  }
}

RunningCommand::~RunningCommand() {
  if (child_ < 0) return;
  send(SIGKILL);
  reap(0);
}

void RunningCommand::send(int signal_number) const {
  if (child_ <= 0) return;
  for (int tries = 0; signal_number == SIGINT && tries < 300 && !catches(child_, signal_number); ++tries)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ::kill(child_, signal_number);
}

bool RunningCommand::ended() {
  reap(WNOHANG);
  return child_ < 0;
}

CommandResult RunningCommand::wait() {
  reap(0);
  result_.out = read_file(*directory_ / "out");
  result_.err = read_file(*directory_ / "err");
  return result_;
}

void RunningCommand::reap(int options) {
  if (child_ < 0) return;
  int status = 0;
  rusage usage{};
  pid_t ended = 0;
  while ((ended = ::wait4(child_, &status, options, &usage)) < 0) {
    if (errno != EINTR) throw std::runtime_error(std::string("wait4: ") + std::strerror(errno));
  }
  if (ended == 0) return;
  child_ = -1;
  result_.status = WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
  result_.peak_mb = static_cast<double>(usage.ru_maxrss) / 1024.0;
}

CommandResult run_command(const std::string& program, const std::vector<std::string>& arguments,
                          const CommandOptions& options) {
  std::vector<std::string> words = {program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return RunningCommand(words, options).wait();
}

std::vector<std::string> on_two_ranks(std::vector<std::string> command) {
#ifdef DOFUSION_MPIRUN
  command[0] = std::string(DOFUSION_BIN_DIR) + "/" + command[0];
  // What Open MPI leaves behind at its end is not the sanitizers' business here.
  std::vector<std::string> all = {
      DOFUSION_MPIRUN, "--allow-run-as-root", "--oversubscribe", "-x", "ASAN_OPTIONS=detect_leaks=0", "-n", "2"};
  all.insert(all.end(), command.begin(), command.end());
  return all;
#else
  command.clear();
  return command;
#endif
}

void expect_refusal(const CommandResult& result, const std::vector<std::string>& words) {
  EXPECT_EQ(result.status, 2) << result.err;
  EXPECT_EQ(result.out, "");
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_TRUE(!result.err.empty() && result.err.back() == '\n') << result.err;
  for (const std::string& word : words) EXPECT_THAT(result.err, testing::HasSubstr(word));
}

void expect_success(const CommandResult& result) { EXPECT_EQ(result.status, 0) << result.err; }

std::vector<std::string> entries(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace dofusion
