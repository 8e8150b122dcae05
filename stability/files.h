// Outputs that are whole or absent: files are written under a temporary name and renamed.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace dofusion {

// Bad input from the user: the message names the file or the argument, what is wrong, and what to do. Programs end
// with this line on stderr and exit status 2.
class InputError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

// The file's bytes. Throws InputError naming the file if it cannot be read.
std::string read_file(const std::filesystem::path& path);

// Writes `bytes` under a temporary name beside `path` and renames it; a device, pipe or link is written to as it is.
// kOnDisk: the bytes are on the disk before the name is, so that not even a power cut leaves a part of them. Throws
// InputError if that is not possible.
enum class Durability { kWritten, kOnDisk };
void write_file(const std::filesystem::path& path, const std::string& bytes,
                Durability durability = Durability::kWritten);

// Writes all of `bytes` to an open file; false, with the reason in errno, if that is not possible.
bool write_all(int file, const std::string& bytes);

// Throws InputError, as write_file would, if `path` cannot be written; for a look before long work.
void check_writable(const std::filesystem::path& path);

// A directory of results that appears whole: fill `path()`, then `commit()` moves it to the target. Where the target
// exists already, entries of the same name are replaced and others are left alone. Without commit the temporary
// directory is removed, and so are the folders above it that were made for it. The constructor throws InputError if the
// target cannot be written or is a file.
class OutputDirectory {
 public:
  explicit OutputDirectory(const std::filesystem::path& target);
  ~OutputDirectory();
  OutputDirectory(const OutputDirectory&) = delete;
  OutputDirectory& operator=(const OutputDirectory&) = delete;
  const std::filesystem::path& path() const { return temporary_; }
  void commit();

 private:
  void remove_made();
  std::filesystem::path target_, temporary_;
  std::vector<std::filesystem::path> made_;  // the temporary directory and what was made above it, innermost first
};

}  // namespace dofusion
