// Mutated PNG files fail their checksums; with these set right the fuzzer reaches what lies behind.
#pragma once

#include <string>

#include <zlib.h>

namespace dofusion {

inline std::string with_right_checksums(std::string png) {
  constexpr std::size_t kSignature = 8, kOverhead = 12;
  const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(png[at]); };
  for (std::size_t at = kSignature; at + kOverhead <= png.size();) {
    const std::size_t length = std::size_t{byte(at)} << 24 | std::size_t{byte(at + 1)} << 16 |
                               std::size_t{byte(at + 2)} << 8 | std::size_t{byte(at + 3)};
    if (length > png.size() - at - kOverhead) break;
    const auto* data = reinterpret_cast<const unsigned char*>(&png[at + 4]);
    const unsigned long checksum = ::crc32(0, data, static_cast<unsigned>(length + 4));
    for (int k = 0; k < 4; ++k) png[at + 8 + length + k] = static_cast<char>(checksum >> (24 - 8 * k) & 0xff);
    at += length + kOverhead;
  }
  return png;
}

// A camera of the size that the PNG's header tells, up to 512 pixels a side; else of 16 x 12.
template <class Camera>
Camera camera_of_png(const std::string& png) {
  Camera camera{500.0, 500.0, 8.0, 6.0, 16, 12, 0.1};
  if (png.size() < 24) return camera;
  const auto number = [&](std::size_t at) {
    int value = 0;
    for (std::size_t k = 0; k < 4; ++k) value = value * 256 % 100000 + static_cast<unsigned char>(png[at + k]);
    return value;
  };
  if (number(16) < 1 || number(16) > 512 || number(20) < 1 || number(20) > 512) return camera;
  camera.width = number(16);
  camera.height = number(20);
  return camera;
}

}  // namespace dofusion
