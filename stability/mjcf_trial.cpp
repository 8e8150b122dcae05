#include "stability/mjcf_trial.h"

#include <cstring>

#include <unistd.h>

#include "stability/child_process.h"
#include "stability/files.h"
#include "stability/mujoco_model.h"

namespace dofusion {
namespace {

constexpr unsigned kSeconds = 60;
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

int build_in_child(const std::string& path, int pipe) {
  report_to = pipe;
  mju_user_error = refuse;
  mju_user_warning = refuse_nan;
  char error[1000] = "";
  if (mj_loadXML(path.c_str(), nullptr, error, sizeof error) == nullptr) refuse(error);
  return kBuilt;
}

}  // namespace

void try_mjcf(const std::string& path) {
  const ChildResult child = run_in_child([&](int pipe) { return build_in_child(path, pipe); }, kSeconds);
  if (child.end == ChildResult::End::kReturned && child.status == kBuilt) return;
  if (child.end == ChildResult::End::kReturned && child.status == kRefused) {
    throw InputError(path + ": MuJoCo cannot build it: " + one_line(child.output));
  }
  if (child.end == ChildResult::End::kOutOfTime) {
    throw InputError(path + ": MuJoCo takes more than a minute to build it");
  }
  throw InputError(path +
                   ": MuJoCo crashes or runs out of memory while it builds it; look for sizes and indices that "
                   "cannot be");
}

}  // namespace dofusion
