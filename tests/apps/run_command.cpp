#include "tests/apps/run_command.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "stability/files.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

constexpr rlim_t kProcessorSeconds = 600;

// In the child, where nothing but calls to the system is safe.
[[noreturn]] void execute(char* const* arguments, const char* out, const char* err) {
  const rlimit limit{kProcessorSeconds, kProcessorSeconds};
  ::setrlimit(RLIMIT_CPU, &limit);
  const int in_file = ::open("/dev/null", O_RDONLY);
  const int out_file = ::open(out, O_CREAT | O_WRONLY, 0600), err_file = ::open(err, O_CREAT | O_WRONLY, 0600);
  if (::dup2(in_file, 0) < 0 || ::dup2(out_file, 1) < 0 || ::dup2(err_file, 2) < 0) ::_exit(126);
  ::execv(arguments[0], arguments);
  ::_exit(127);
}

}  // namespace

CommandResult run_command(const std::string& program, const std::vector<std::string>& arguments) {
  const TemporaryDirectory directory;
  const std::string out = directory / "out", err = directory / "err";
  std::vector<std::string> words = {std::string(DOFUSION_BIN_DIR) + "/" + program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);

  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error(std::string("fork: ") + std::strerror(errno));
  if (child == 0) execute(pointers.data(), out.c_str(), err.c_str());
  int status = 0;
  rusage usage{};
  while (::wait4(child, &status, 0, &usage) < 0) {
    if (errno != EINTR) throw std::runtime_error(std::string("wait4: ") + std::strerror(errno));
  }
  CommandResult result;
  result.status = WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
  result.peak_mb = static_cast<double>(usage.ru_maxrss) / 1024.0;
  result.out = read_file(out);
  result.err = read_file(err);
  return result;
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
  for (const auto& entry : std::filesystem::directory_iterator(folder)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace dofusion
