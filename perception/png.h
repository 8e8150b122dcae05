// PNG files as bytes: what the depth, label and colour images have in common. Internal.
#pragma once

#include <string>

namespace dofusion {

struct PngHeader {
  int width = 0, height = 0;
  int bits = 0;      // per channel
  int channels = 0;  // 1 grey or palette, 2 grey with alpha, 3 RGB, 4 RGBA
};

// Reads the header and checks every chunk to the last, so that a decoder never sees half an image. Throws
// InputError naming `path` if the bytes are no PNG, or a truncated or damaged one.
PngHeader check_png(const std::string& bytes, const std::string& path);

// The decoded pixels, row-major, of an image that check_png accepted; T is its channel's type. Throws InputError
// naming `path` if they cannot be decoded. Defined for std::uint8_t and std::uint16_t with one channel.
template <class T>
void decode_grey_png(const std::string& bytes, const std::string& path, T* pixels, int width, int height);

// Encodes row-major pixels: one channel of 8 or 16 bits, or RGB of 3 x 8 bits.
std::string encode_grey_png(const unsigned char* pixels, int width, int height);
std::string encode_grey_png(const unsigned short* pixels, int width, int height);
std::string encode_rgb_png(const unsigned char* pixels, int width, int height);

}  // namespace dofusion
