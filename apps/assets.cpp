#include "apps/assets.h"

#include <cstdlib>
#include <filesystem>

#include "stability/files.h"

namespace dofusion {
namespace fs = std::filesystem;

std::string assets_directory() {
  if (const char* chosen = std::getenv("DOFUSION_ASSETS")) {
    if (!fs::is_directory(chosen)) throw InputError(std::string(chosen) + ": DOFUSION_ASSETS is not a directory");
    return chosen;
  }
  // Installed: bin/program beside share/dofusion/assets. Built: the source tree.
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const fs::path installed = program.parent_path().parent_path() / "share/dofusion/assets";
  for (const fs::path& candidate : {installed, fs::path(DOFUSION_SOURCE_ASSETS)}) {
    if (fs::is_directory(candidate, error)) return candidate.string();
  }
  throw InputError("the assets folder is not at " + installed.string() + "; set DOFUSION_ASSETS to it");
}

std::string default_model_path() { return assets_directory() + "/models/default.safetensors"; }

}  // namespace dofusion
