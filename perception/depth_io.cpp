#include "perception/depth_io.h"

#include <cmath>
#include <cstdint>
#include <vector>

#include "perception/png.h"
#include "stability/files.h"

namespace dofusion {
namespace {

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

// Throws unless the bytes are a whole one-channel PNG with `bits` bits of the camera's size.
void check_image(const std::string& bytes, const std::string& path, const Camera& camera, int bits,
                 const std::string& kind) {
  const PngHeader header = check_png(bytes, path);
  if (header.bits != bits || header.channels != 1)
    throw InputError(path + ": has " + std::to_string(header.channels) + " channel(s) of " +
                     std::to_string(header.bits) + " bits; " + kind + " must have one channel of " +
                     std::to_string(bits) + " bits");
  if (header.width != camera.width || header.height != camera.height)
    throw InputError(path + ": is " + size_text(header.width, header.height) + " pixels, but the camera says " +
                     size_text(camera.width, camera.height) + "; use the camera file that belongs to the image");
}

}  // namespace

DepthImage read_depth(const std::string& path, const Camera& camera) {
  const std::string bytes = read_file(path);
  check_image(bytes, path, camera, 16, "a depth image");
  std::vector<std::uint16_t> steps(static_cast<std::size_t>(camera.width) * camera.height);
  decode_grey_png(bytes, path, steps.data(), camera.width, camera.height);
  DepthImage depth(camera.width, camera.height);
  const double step = camera.depth_scale / 1000.0;  // metres
  for (std::size_t i = 0; i < steps.size(); ++i) depth.pixels[i] = static_cast<float>(steps[i] * step);
  return depth;
}

void write_depth(const DepthImage& depth, const Camera& camera, const std::string& path) {
  constexpr double kLargest = 65535.0;
  std::vector<std::uint16_t> steps(depth.pixels.size());
  const double steps_per_metre = 1000.0 / camera.depth_scale;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double value = std::round(depth.pixels[i] * steps_per_metre);
    // Written so that NaN becomes "no reading" as well.
    steps[i] = value > 0.0 && value <= kLargest ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
  }
  write_file(path, encode_grey_png(steps.data(), depth.width, depth.height));
}

LabelImage read_labels(const std::string& path, const Camera& camera) {
  const std::string bytes = read_file(path);
  check_image(bytes, path, camera, 8, "a label image");
  LabelImage labels(camera.width, camera.height);
  decode_grey_png(bytes, path, labels.pixels.data(), camera.width, camera.height);
  return labels;
}

void write_labels(const LabelImage& labels, const std::string& path) {
  write_file(path, encode_grey_png(labels.pixels.data(), labels.width, labels.height));
}

}  // namespace dofusion
