#include "perception/png.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <vector>

#include <zlib.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

constexpr char kSignature[] = "\x89PNG\r\n\x1a\n";
constexpr std::size_t kSignatureSize = 8;
constexpr std::size_t kChunkOverhead = 12;  // bytes around a chunk's data: length, type, checksum

std::uint32_t big_endian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

// The cyclic redundancy check of PNG's section 5.5 (polynomial 0xEDB88320, reflected).
std::uint32_t checksum(const char* data, std::size_t size) {
  static const std::array<std::uint32_t, 256> table = [] {
    std::array<std::uint32_t, 256> t{};
    for (std::uint32_t n = 0; n < 256; ++n) {
      t[n] = n;
      for (int k = 0; k < 8; ++k) t[n] = (t[n] & 1u) ? 0xEDB88320u ^ (t[n] >> 1) : t[n] >> 1;
    }
    return t;
  }();
  std::uint32_t c = 0xFFFFFFFFu;
  for (std::size_t i = 0; i < size; ++i) c = table[(c ^ static_cast<unsigned char>(data[i])) & 0xFFu] ^ (c >> 8);
  return ~c;
}

int channels_of(unsigned char colour_type) {
  switch (colour_type) {
    case 2:
      return 3;
    case 4:
      return 2;
    case 6:
      return 4;
    default:
      return 1;  // 0 grey, 3 palette
  }
}

std::string encode(const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", image, bytes)) throw std::runtime_error("OpenCV cannot encode a PNG");
  return {bytes.begin(), bytes.end()};
}

// OpenCV takes a pointer to what it only reads as one to what it may write.
cv::Mat view(const void* pixels, int width, int height, int type) {
  return {height, width, type, const_cast<void*>(pixels)};
}

}  // namespace

PngHeader check_png(const std::string& bytes, const std::string& path) {
  if (bytes.empty()) throw InputError(path + ": the file is empty");
  if (bytes.compare(0, kSignatureSize, kSignature, kSignatureSize) != 0)
    throw InputError(path + ": not a PNG file; images are read from PNG alone");
  PngHeader header;
  bool ended = false;
  for (std::size_t at = kSignatureSize; !ended;) {
    const bool complete =
        at + kChunkOverhead <= bytes.size() && big_endian(bytes, at) <= bytes.size() - at - kChunkOverhead;
    if (!complete)
      throw InputError(path + ": the PNG is truncated after " + std::to_string(bytes.size()) +
                       " bytes; copy or export it again");
    const std::size_t length = big_endian(bytes, at);
    const std::string type = bytes.substr(at + 4, 4);
    const std::size_t data = at + 8;
    if (checksum(&bytes[at + 4], length + 4) != big_endian(bytes, data + length))
      throw InputError(path + ": the PNG is damaged (checksum of chunk at byte " + std::to_string(at) +
                       "); copy or export it again");
    if (at > kSignatureSize && type == "IHDR") throw InputError(path + ": the PNG is damaged (a second header)");
    if (at == kSignatureSize) {
      if (type != "IHDR" || length != 13) throw InputError(path + ": the PNG is damaged (no header)");
      header.width = static_cast<int>(std::min(big_endian(bytes, data), 0x7FFFFFFFu));
      header.height = static_cast<int>(std::min(big_endian(bytes, data + 4), 0x7FFFFFFFu));
      header.bits = static_cast<unsigned char>(bytes[data + 8]);
      header.channels = channels_of(static_cast<unsigned char>(bytes[data + 9]));
    }
    ended = type == "IEND";
    at = data + length + 4;
  }
  return header;
}

namespace {

// A decoder that meets a short or damaged stream prints to stderr; so the rows are looked at first. True if the
// image data inflate to whole rows that begin with one of the five filters. Interlaced images have other rows; of
// these only the stream is checked.
bool has_whole_rows(const std::string& bytes) {
  std::size_t row_bytes = 0, rows = 0;
  bool interlaced = false;
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return false;
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, inflateEnd);
  std::vector<unsigned char> row;
  int status = Z_OK;
  for (std::size_t at = kSignatureSize; at + kChunkOverhead <= bytes.size() && status == Z_OK;) {
    const std::size_t length = big_endian(bytes, at);
    const std::string type = bytes.substr(at + 4, 4);
    if (type == "IHDR") {
      const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(bytes[at + 8 + k]); };
      const std::size_t bits = std::size_t{byte(8)} * static_cast<std::size_t>(channels_of(byte(9)));
      row_bytes = 1 + (std::size_t{big_endian(bytes, at + 8)} * bits + 7) / 8;
      interlaced = byte(12) != 0;
      row.resize(row_bytes);
      stream.next_out = row.data();
      stream.avail_out = static_cast<unsigned>(row_bytes);
    } else if (type == "IDAT") {
      stream.next_in = reinterpret_cast<unsigned char*>(const_cast<char*>(&bytes[at + 8]));
      stream.avail_in = static_cast<unsigned>(length);
      while (status == Z_OK && stream.avail_in > 0) {
        status = inflate(&stream, Z_NO_FLUSH);
        if (stream.avail_out > 0) continue;
        if (!interlaced && row[0] > 4) return false;
        ++rows;
        stream.next_out = row.data();
        stream.avail_out = static_cast<unsigned>(row_bytes);
      }
    }
    at += length + kChunkOverhead;
  }
  return status == Z_STREAM_END && (interlaced || (rows == big_endian(bytes, kSignatureSize + 12) && stream.avail_out == row_bytes));
}

}  // namespace

template <class T>
void decode_grey_png(const std::string& bytes, const std::string& path, T* pixels, int width, int height) {
  const int type = sizeof(T) == 1 ? CV_8UC1 : CV_16UC1;
  cv::Mat image;
  try {
    if (has_whole_rows(bytes)) image = cv::imdecode(view(bytes.data(), static_cast<int>(bytes.size()), 1, CV_8UC1), cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.cols != width || image.rows != height || image.type() != type)
    throw InputError(path + ": the PNG cannot be decoded; export it again as one grey channel");
  image.copyTo(cv::Mat(height, width, type, pixels));
}
template void decode_grey_png(const std::string&, const std::string&, std::uint8_t*, int, int);
template void decode_grey_png(const std::string&, const std::string&, std::uint16_t*, int, int);

std::string encode_grey_png(const unsigned char* pixels, int width, int height) {
  return encode(view(pixels, width, height, CV_8UC1));
}

std::string encode_grey_png(const unsigned short* pixels, int width, int height) {
  return encode(view(pixels, width, height, CV_16UC1));
}

std::string encode_rgb_png(const unsigned char* pixels, int width, int height) {
  cv::Mat bgr;
  cv::cvtColor(view(pixels, width, height, CV_8UC3), bgr, cv::COLOR_RGB2BGR);
  return encode(bgr);
}

}  // namespace dofusion
