#include "stability/child_process.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace dofusion {
namespace {

#ifdef __SANITIZE_ADDRESS__
#define DOFUSION_ADDRESS_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define DOFUSION_ADDRESS_SANITIZER 1
#endif
#endif

void set_limit(__rlimit_resource resource, rlim_t value) {
  const rlimit limit{value, value};
  ::setrlimit(resource, &limit);
}

// noexcept: what the work may throw (no memory) must end the child here.
[[noreturn]] void run(const std::function<int(int pipe)>& work, int pipe, unsigned cpu_seconds) noexcept {
  const int nowhere = ::open("/dev/null", O_RDWR);
  for (const int file : {0, 1, 2}) ::dup2(nowhere, file);
  for (const int crash :
       {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGXCPU, SIGINT, SIGTERM, SIGALRM, SIGUSR1, SIGUSR2}) {
    std::signal(crash, SIG_DFL);
  }
  set_limit(RLIMIT_CORE, 0);
  set_limit(RLIMIT_CPU, cpu_seconds);
#ifndef DOFUSION_ADDRESS_SANITIZER  // which maps terabytes
  set_limit(RLIMIT_AS, rlim_t{8} << 30);
#endif
  ::_exit(work(pipe));
}

std::string read_to_end(int file) {
  std::string text;
  std::array<char, 65536> buffer;
  for (;;) {
    const ssize_t count = ::read(file, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

std::runtime_error no_child() { return std::runtime_error(std::string("no child process: ") + std::strerror(errno)); }

}  // namespace

ChildResult run_in_child(const std::function<int(int pipe)>& work, unsigned cpu_seconds) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw no_child();
  const pid_t child = ::fork();
  if (child == 0) run(work, ends[1], cpu_seconds);
  const int error = errno;
  ::close(ends[1]);
  ChildResult result;
  result.output = read_to_end(ends[0]);
  ::close(ends[0]);
  errno = error;
  if (child < 0) throw no_child();
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) throw no_child();
  }
  if (WIFEXITED(status)) {
    result.end = ChildResult::End::kReturned;
    result.status = WEXITSTATUS(status);
  } else if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL)) {
    result.end = ChildResult::End::kOutOfTime;
  }
  return result;
}

}  // namespace dofusion
