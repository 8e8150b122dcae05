// A plain image that needs no library in headers.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace dofusion {

// Row-major pixels; (row, column) = (v, u).
template <class T>
struct Image {
  int width = 0;
  int height = 0;
  std::vector<T> pixels;  // (height * width)

  Image() = default;
  Image(int width_, int height_, const T& value = T{})
      : width(width_), height(height_), pixels(static_cast<std::size_t>(width_) * height_, value) {}
  T& at(int row, int column) { return pixels[static_cast<std::size_t>(row) * width + column]; }
  const T& at(int row, int column) const { return pixels[static_cast<std::size_t>(row) * width + column]; }
  bool contains(int row, int column) const { return row >= 0 && column >= 0 && row < height && column < width; }
};

using DepthImage = Image<float>;         // z-depth in metres; 0 = no reading
using LabelImage = Image<std::uint8_t>;  // 0 nothing, 1 table, 2 + i object i
using NormalImage = Image<Eigen::Vector3f>;
using IdImage = Image<std::int32_t>;  // indices; -1 nothing
using AngleImage = Image<float>;      // radians

inline constexpr std::uint8_t kLabelNothing = 0;
inline constexpr std::uint8_t kLabelTable = 1;
inline constexpr std::uint8_t kLabelFirstObject = 2;

}  // namespace dofusion
