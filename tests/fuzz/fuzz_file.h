// What all fuzz targets of file readers share.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "stability/files.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace dofusion {

inline std::string to_bytes(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

// Hands `read` the path of a file of these bytes. The reader may return or throw InputError; anything else is a finding.
template <class Read>
void fuzz_file(const std::string& bytes, const std::string& extension, const Read& read) {
  static const std::string stem =
      (std::filesystem::temp_directory_path() / ("dofusion_fuzz_" + std::to_string(::getpid()))).string();
  const std::string path = stem + extension;
  std::ofstream(path, std::ios::binary | std::ios::trunc).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  try {
    read(path);
  } catch (const InputError&) {
  }
  ::unlink(path.c_str());
}

}  // namespace dofusion
