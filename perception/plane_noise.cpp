#include "perception/plane_noise.h"

#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include <Eigen/Dense>

#include "perception/table.h"

namespace dofusion {
namespace {

// True if all of the window and the margin around it is the table, with readings.
bool is_table(const DepthImage& depth, const LabelImage& labels, int row, int column, const PlaneNoiseOptions& o) {
  for (int v = row - o.margin; v < row + o.window + o.margin; ++v) {
    for (int u = column - o.margin; u < column + o.window + o.margin; ++u) {
      if (!depth.contains(v, u) || labels.at(v, u) != kLabelTable || !is_valid_depth(depth.at(v, u))) return false;
    }
  }
  return true;
}

struct WindowNoise {
  double depth = 0.0, variance = 0.0;  // metres, square metres
};

// Over so few pixels the depth of a plane is linear in the pixel to a tenth of a millimetre.
WindowNoise window_noise(const DepthImage& depth, int row, int column, int window) {
  const double centre = (window - 1) / 2.0;
  double sum = 0.0, sum_x = 0.0, sum_y = 0.0, sum_squares = 0.0, spread = 0.0;
  for (int v = 0; v < window; ++v) {
    for (int u = 0; u < window; ++u) {
      const double z = depth.at(row + v, column + u) - depth.at(row, column);
      sum += z;
      sum_x += (u - centre) * z;
      sum_y += (v - centre) * z;
      sum_squares += z * z;
      spread += (u - centre) * (u - centre);
    }
  }
  const double n = window * window;
  const double residual = sum_squares - sum * sum / n - (sum_x * sum_x + sum_y * sum_y) / spread;
  return {depth.at(row, column) + sum / n, std::max(residual, 0.0) / (n - 3.0)};
}

}  // namespace

double NoiseBin::sigma() const { return pixels == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(pixels)); }

std::vector<NoiseBin> noise_bins(const std::vector<double>& distances) {
  std::vector<NoiseBin> bins;
  for (const double distance : distances) bins.push_back({distance, 0.0, 0});
  return bins;
}

void add_plane_noise(const DepthImage& depth, const LabelImage& labels, std::vector<NoiseBin>& bins,
                     const PlaneNoiseOptions& options) {
  if (depth.width != labels.width || depth.height != labels.height)
    throw std::invalid_argument("depth and labels differ in size");
  if (options.window < 3)
    throw std::invalid_argument("a plane needs windows of 3 pixels, not " + std::to_string(options.window));
  for (int row = 0; row + options.window <= depth.height; row += options.window) {
    for (int column = 0; column + options.window <= depth.width; column += options.window) {
      if (!is_table(depth, labels, row, column, options)) continue;
      const WindowNoise noise = window_noise(depth, row, column, options.window);
      const auto pixels = static_cast<std::size_t>(options.window) * static_cast<std::size_t>(options.window);
      for (NoiseBin& bin : bins) {
        if (std::abs(noise.depth - bin.distance) > options.half_width) continue;
        bin.squares += noise.variance * static_cast<double>(pixels);
        bin.pixels += pixels;
      }
    }
  }
}

}  // namespace dofusion
