#include "stability/mjcf_trial.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "stability/files.h"
#include "stability/mujoco_model.h"

namespace dofusion {
namespace {

constexpr rlim_t kSeconds = 60, kBytes = rlim_t{8} << 30;
constexpr int kBuilt = 0, kRefused = 3;  // exit statuses of the child

int report_to = -1;

// To the parent, and no further.
[[noreturn]] void refuse(const char* reason) {
  const ssize_t ignored = ::write(report_to, reason, std::strlen(reason));
  static_cast<void>(ignored);
  ::_exit(kRefused);
}

// MuJoCo only warns of a NaN, and may go on with 0 in its place.
void refuse_nan(const char* warning) {
  if (std::strstr(warning, "'NaN'") != nullptr) refuse(warning);
}

void set_limit(__rlimit_resource resource, rlim_t value) {
  const rlimit limit{value, value};
  ::setrlimit(resource, &limit);
}

// noexcept: what MuJoCo may throw (no memory) must end the child here.
[[noreturn]] void build_in_child(const char* path) noexcept {
  const int nowhere = ::open("/dev/null", O_RDWR);
  for (const int file : {0, 1, 2}) ::dup2(nowhere, file);
  for (const int crash : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGXCPU, SIGINT, SIGTERM}) {
    std::signal(crash, SIG_DFL);
  }
  set_limit(RLIMIT_CORE, 0);
  set_limit(RLIMIT_CPU, kSeconds);
#ifndef __SANITIZE_ADDRESS__  // which maps terabytes
  set_limit(RLIMIT_AS, kBytes);
#endif
  mju_user_error = refuse;
  mju_user_warning = refuse_nan;
  char error[1000] = "";
  if (mj_loadXML(path, nullptr, error, sizeof error) == nullptr) refuse(error);
  ::_exit(kBuilt);
}

std::string read_to_end(int file) {
  std::string text;
  std::array<char, 1024> buffer;
  for (;;) {
    const ssize_t count = ::read(file, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

std::runtime_error no_trial() { return std::runtime_error(std::string("MuJoCo's trial: ") + std::strerror(errno)); }

}  // namespace

void try_mjcf(const std::string& path) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw no_trial();
  const pid_t child = ::fork();
  if (child == 0) {
    report_to = ends[1];
    build_in_child(path.c_str());
  }
  ::close(ends[1]);
  const std::string reason = read_to_end(ends[0]);
  ::close(ends[0]);
  if (child < 0) throw no_trial();
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) throw no_trial();
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == kBuilt) return;
  if (WIFEXITED(status) && WEXITSTATUS(status) == kRefused) {
    throw InputError(path + ": MuJoCo cannot build it: " + one_line(reason));
  }
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU) {
    throw InputError(path + ": MuJoCo takes more than a minute to build it");
  }
  throw InputError(path +
                   ": MuJoCo crashes or runs out of memory while it builds it; look for sizes and indices that "
                   "cannot be");
}

}  // namespace dofusion
