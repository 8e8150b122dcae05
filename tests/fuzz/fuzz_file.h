// What all fuzz targets of file readers share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>

#include "stability/files.h"
#include "tests/temporary_directory.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace dofusion {

inline std::string to_bytes(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

// Hands `read` the path of a file of these bytes, one for all inputs of a process. The reader may return or throw
// InputError; anything else is a finding.
template <class Read>
void fuzz_file(const std::string& bytes, const std::string& extension, const Read& read) {
  static const TemporaryDirectory directory;
  const std::string path = directory / ("input" + extension);
  std::ofstream(path, std::ios::binary | std::ios::trunc)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  try {
    read(path);
  } catch (const InputError&) {
  }
}

}  // namespace dofusion
