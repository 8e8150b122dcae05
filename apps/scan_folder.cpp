#include "apps/scan_folder.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "stability/files.h"

namespace dofusion {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr char kRecord[] = "settings.partial.json";

// What a kill left of files that write_file was writing.
void remove_temporary_files(const fs::path& folder) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::error_code ignored;
    if (name.front() == '.' && name.find(".tmp") != std::string::npos && entry->is_regular_file(ignored)) {
      fs::remove(entry->path(), ignored);
    }
  }
}

// "seed 9, not 10"; of settings within settings the inner ones.
std::string first_difference(const ordered_json& before, const ordered_json& now) {
  if (!before.is_object()) return "other settings";
  for (const auto& [key, value] : now.items()) {
    const ordered_json was = before.value(key, ordered_json());
    if (was == value) continue;
    if (was.is_object() && value.is_object()) return first_difference(was, value);
    return key + " " + was.dump() + ", not " + value.dump();
  }
  return "other settings";
}

}  // namespace

ScanFolder::ScanFolder(const fs::path& out, const ordered_json& settings) {
  if (out.empty()) throw InputError("--out: the name of a folder is needed");
  out_ = fs::absolute(out).lexically_normal();
  if (out_.filename().empty()) out_ = out_.parent_path();  // "out/" names the folder out
  partial_ = out_.string() + ".partial";
  record_ = partial_ / kRecord;
  std::error_code error;
  if (fs::exists(out_, error) && !(fs::is_directory(out_, error) && fs::is_empty(out_, error))) {
    throw InputError(out.string() + ": is there already; delete it or choose another --out");
  }
  const bool began = !fs::exists(record_, error);
  if (began && fs::exists(partial_, error) && !fs::is_empty(partial_, error)) {
    throw InputError(partial_.string() +
                     ": is there already and no scan left it; move it away or choose another --out");
  }
  fs::create_directories(partial_, error);
  if (error) throw InputError(out.string() + ": cannot be created (" + error.message() + ")");
  lock_ = ::open(partial_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_ < 0) throw InputError(partial_.string() + ": cannot be opened (" + std::strerror(errno) + ")");
  if (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock_);
    throw InputError(partial_.string() + ": another run is working in it; wait for it, or choose another --out");
  }
  const std::string text = settings.dump(2) + "\n";
  try {
    if (fs::exists(record_, error)) {
      check_settings(text);
      remove_temporary_files(partial_);
      resumed_ = true;
    } else {
      write_file(record_, text);
    }
  } catch (...) {
    if (began) fs::remove(partial_, error);
    ::close(lock_);
    throw;
  }
}

ScanFolder::~ScanFolder() {
  if (lock_ >= 0) ::close(lock_);
}

void ScanFolder::check_settings(const std::string& text) const {
  const std::string before = read_file(record_);
  if (before == text) return;
  const std::string difference =
      first_difference(ordered_json::parse(before, nullptr, false), ordered_json::parse(text));
  throw InputError(partial_.string() + ": was begun with " + difference +
                   "; give the arguments that it was begun with, or delete it to begin anew");
}

void ScanFolder::commit() {
  std::error_code error;
  fs::remove(record_, error);
  if (!error) fs::rename(partial_, out_, error);
  if (error) throw InputError(out_.string() + ": cannot be written (" + error.message() + ")");
}

void ScanFolder::discard() {
  std::error_code ignored;
  fs::remove_all(partial_, ignored);
}

}  // namespace dofusion
