#include "stability/mujoco_model.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <stdexcept>

#include "stability/face_contacts.h"
#include "stability/files.h"

namespace dofusion {
namespace {

void ignore_warning(const char*) {}  // warnings are read from mjData; MuJoCo's own handler writes a log file

// MuJoCo must not return from an error (its memory ran out), and its own handler waits for a key.
void exit_on_error(const char* message) {
  std::fprintf(stderr, "MuJoCo: %s\n", message);
  std::_Exit(1);
}

// The XML reader keeps process-wide state.
std::unique_lock<std::mutex> lock_reader() {
  static std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  mju_user_warning = ignore_warning;
  mju_user_error = exit_on_error;
  use_face_contacts();
  return lock;
}

std::string one_line(const char* text) {
  std::string line = text;
  for (char& c : line) {
    if (c == '\n') c = ' ';
  }
  return line;
}

}  // namespace

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
  char error[1000] = "";
  ModelPtr model(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  if (!model) throw InputError(path + ": MuJoCo cannot build it: " + one_line(error));
  return model;
}

DataPtr make_data(const mjModel& model) {
  DataPtr data(mj_makeData(&model));
  if (!data) throw std::runtime_error("MuJoCo: no memory for the simulation");
  return data;
}

bool has_diverged(const mjData& data) {
  for (const int warning : {mjWARN_CONTACTFULL, mjWARN_CNSTRFULL, mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) {
    if (data.warning[warning].number > 0) return true;
  }
  return false;
}

}  // namespace dofusion
