#include "stability/files.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
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

// Moves every file below `from` to the same place below `to`. Files of the same name are replaced; whatever else the
// user keeps there stays.
void merge(const fs::path& from, const fs::path& to, std::error_code& error) {
  for (fs::directory_iterator entry(from, error), end; !error && entry != end; entry.increment(error)) {
    const fs::path place = to / entry->path().filename();
    if (entry->is_directory() && fs::is_directory(place)) {
      merge(entry->path(), place, error);
    } else {
      fs::rename(entry->path(), place, error);
    }
  }
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

bool write_all(int file, const std::string& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t written = ::write(file, bytes.data() + done, bytes.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    done += static_cast<std::size_t>(written);
  }
  return true;
}

void write_file(const fs::path& path, const std::string& bytes, Durability durability) {
  // Devices, pipes and links (/dev/stdout is one) are written to, not replaced.
  std::error_code unknown;
  const fs::file_status status = fs::symlink_status(path, unknown);
  const bool in_place = fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
  const fs::path temporary = in_place ? path : temporary_name(path);
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  bool good = file >= 0 && write_all(file, bytes);
  if (good && durability == Durability::kOnDisk && !in_place) good = ::fsync(file) == 0;
  int reason = good ? 0 : errno;
  if (file >= 0 && ::close(file) != 0 && good) reason = errno;
  if (reason != 0) {
    std::error_code ignored;
    if (!in_place) fs::remove(temporary, ignored);
    throw InputError(path.string() + ": cannot be written (" + std::strerror(reason) + ")" +
                     (file < 0 ? "; does its folder exist and is it writable?" : ""));
  }
  if (in_place) return;
  std::error_code error;
  fs::rename(temporary, path, error);
  if (error) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw InputError(path.string() + ": cannot be written (" + error.message() + ")");
  }
}

void check_writable(const fs::path& path) {
  std::error_code error;
  if (fs::exists(path, error) && !fs::is_regular_file(path, error)) {
    if (fs::is_directory(path, error)) throw InputError(path.string() + ": is a directory, not a file");
    return;  // a device or a pipe
  }
  const fs::path probe = temporary_name(path);
  const bool opened = std::ofstream(probe).is_open();
  fs::remove(probe, error);
  if (!opened) throw InputError(path.string() + ": cannot be written; does its folder exist and is it writable?");
}

OutputDirectory::OutputDirectory(const fs::path& target) {
  if (target.empty()) throw InputError("the output directory has an empty name");
  target_ = fs::absolute(target).lexically_normal();
  if (target_.filename().empty()) target_ = target_.parent_path();  // "out/" names the folder out
  std::error_code error;
  const bool there = fs::exists(target_, error);
  if (there && !fs::is_directory(target_, error)) {
    throw InputError(target.string() + ": is a file; --out needs a directory");
  }
  // Inside a target that is there: it may be writable where its parent is not, or be another file system.
  temporary_ = there ? temporary_name(target_ / "dofusion") : temporary_name(target_);
  for (fs::path p = temporary_; !fs::exists(p, error) && p.has_relative_path(); p = p.parent_path()) made_.push_back(p);
  fs::remove_all(temporary_, error);  // left by a process that was killed
  fs::create_directories(temporary_, error);
  if (error) {
    remove_made();
    throw InputError(target.string() + ": cannot be created (" + error.message() + ")");
  }
}

OutputDirectory::~OutputDirectory() {
  if (!temporary_.empty()) remove_made();
}

void OutputDirectory::remove_made() {
  std::error_code ignored;
  fs::remove_all(temporary_, ignored);
  for (const fs::path& folder : made_) fs::remove(folder, ignored);  // fails on one that others have used since
}

void OutputDirectory::commit() {
  std::error_code error;
  if (!fs::exists(target_, error)) {
    fs::rename(temporary_, target_, error);
  } else {
    merge(temporary_, target_, error);
  }
  if (error) throw InputError(target_.string() + ": cannot be written (" + error.message() + ")");
  fs::remove_all(temporary_, error);
  temporary_.clear();
}

}  // namespace dofusion
