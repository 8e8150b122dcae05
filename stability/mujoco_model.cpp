#include "stability/mujoco_model.h"

#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <stdexcept>

#include "stability/face_contacts.h"
#include "stability/files.h"
#include "stability/mjcf_trial.h"

namespace dofusion {
namespace {

void ignore_warning(const char*) {}  // warnings are read from mjData; MuJoCo's own handler writes a log file

// Where this thread's call of MuJoCo began, and what MuJoCo said when it came back here.
thread_local std::jmp_buf* beginning = nullptr;
thread_local char last_error[256] = "";

// MuJoCo must not return from an error (its stack or the memory ran out), and its own handler waits for a key. Its
// engine is C, so that the call can be left by a jump; elsewhere nothing is left but to end.
void leave_on_error(const char* message) {
  std::snprintf(last_error, sizeof last_error, "%s", message);
  if (beginning != nullptr) std::longjmp(*beginning, 1);
  std::fprintf(stderr, "MuJoCo: %s\n", message);
  std::_Exit(1);
}

// False if the call was left. Nothing that needs a destructor may live in `call`, nor in what MuJoCo calls back.
template <class Call>
bool comes_back(const Call& call) {
  std::jmp_buf here;
  if (setjmp(here) != 0) {
    beginning = nullptr;
    return false;
  }
  beginning = &here;
  call();
  beginning = nullptr;
  return true;
}

template <class Call>
void run(const Call& call) {
  if (!comes_back(call)) throw MujocoError("MuJoCo: " + one_line(last_error));
}

// The XML reader keeps process-wide state.
std::unique_lock<std::mutex> lock_reader() {
  static std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  mju_user_warning = ignore_warning;
  mju_user_error = leave_on_error;
  use_face_contacts();
  return lock;
}

}  // namespace

std::string one_line(const std::string& text) {
  std::string line;
  for (const char c : text) {
    const bool space = static_cast<unsigned char>(c) <= 32 || c == 127;
    if (!space) line += c;
    if (space && !line.empty() && line.back() != ' ') line += ' ';
  }
  if (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

ModelPtr compile_mjcf(const std::string& text) {
  const auto lock = lock_reader();
  // One for all: of 2 MB, it would leave a hole in the heap beside every model.
  static mjVFS vfs;
  mj_defaultVFS(&vfs);
  const char* name = "scene.xml";
  if (mj_makeEmptyFileVFS(&vfs, name, static_cast<int>(text.size())) != 0) {
    throw std::runtime_error("MuJoCo: no memory for the scene's XML");
  }
  std::memcpy(vfs.filedata[mj_findFileVFS(&vfs, name)], text.data(), text.size());
  char error[1000] = "";
  ModelPtr model(mj_loadXML(name, &vfs, error, sizeof error));
  mj_deleteVFS(&vfs);
  if (!model) throw std::runtime_error("MuJoCo cannot build the scene: " + one_line(error));
  return model;
}

ModelPtr load_mjcf(const std::string& path) {
  std::error_code missing;
  if (!std::filesystem::is_regular_file(path, missing)) throw InputError(path + ": no such MJCF file");
  const auto lock = lock_reader();
  try_mjcf(path);
  char error[1000] = "";
  ModelPtr model(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  if (!model) throw InputError(path + ": MuJoCo cannot build it: " + one_line(error));
  return model;
}

DataPtr make_data(const mjModel& model) {
  mjData* data = nullptr;
  run([&] { data = mj_makeData(&model); });
  if (data == nullptr) throw MujocoError("MuJoCo: no memory for the simulation");
  return DataPtr(data);
}

void step(const mjModel& model, mjData& data) {
  run([&] { mj_step(&model, &data); });
}

void collide(const mjModel& model, mjData& data) {
  run([&] { mj_collision(&model, &data); });
}

bool has_diverged(const mjData& data) {
  for (const int warning : {mjWARN_CONTACTFULL, mjWARN_CNSTRFULL, mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) {
    if (data.warning[warning].number > 0) return true;
  }
  return false;
}

}  // namespace dofusion
