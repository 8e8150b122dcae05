#include "stability/files.h"

#include <unistd.h>

#include <fstream>
#include <sstream>
#include <system_error>

namespace dofusion {
namespace fs = std::filesystem;
namespace {

fs::path temporary_name(const fs::path& target) {
  fs::path name = target.filename();
  if (name.empty()) name = target.parent_path().filename();  // "out/" names the folder out
  const fs::path parent = target.filename().empty() ? target.parent_path().parent_path() : target.parent_path();
  return parent / ("." + name.string() + ".tmp" + std::to_string(::getpid()));
}

}  // namespace

std::string read_file(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) throw InputError(path.string() + ": no such file");
  if (fs::is_directory(path, error)) throw InputError(path.string() + ": is a directory, not a file");
  std::ifstream in(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << in.rdbuf();
  if (!in) throw InputError(path.string() + ": cannot be read");
  return bytes.str();
}

void write_file(const fs::path& path, const std::string& bytes) {
  const fs::path temporary = temporary_name(path);
  {
    std::ofstream out(temporary, std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) {
      std::error_code ignored;
      fs::remove(temporary, ignored);
      throw InputError(path.string() + ": cannot be written; does its folder exist and is it writable?");
    }
  }
  std::error_code error;
  fs::rename(temporary, path, error);
  if (error) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw InputError(path.string() + ": cannot be written (" + error.message() + ")");
  }
}

OutputDirectory::OutputDirectory(const fs::path& target)
    : target_(fs::absolute(target).lexically_normal()), temporary_(temporary_name(target_)) {
  std::error_code error;
  if (fs::exists(target_, error) && !fs::is_directory(target_, error)) {
    throw InputError(target.string() + ": is a file; --out needs a directory");
  }
  fs::create_directories(temporary_, error);
  if (error) throw InputError(target.string() + ": cannot be created (" + error.message() + ")");
}

OutputDirectory::~OutputDirectory() {
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
}

void OutputDirectory::commit() {
  const fs::path target = target_.filename().empty() ? target_.parent_path() : target_;
  std::error_code error;
  if (!fs::exists(target)) {
    fs::rename(temporary_, target, error);
  } else {
    // Entry by entry: what else the user keeps in that directory stays.
    for (const fs::directory_entry& entry : fs::directory_iterator(temporary_)) {
      const fs::path place = target / entry.path().filename();
      if (entry.is_directory()) fs::remove_all(place, error);
      if (!error) fs::rename(entry.path(), place, error);
      if (error) break;
    }
  }
  if (error) throw InputError(target.string() + ": cannot be written (" + error.message() + ")");
  fs::remove_all(temporary_, error);
  temporary_.clear();
}

}  // namespace dofusion
