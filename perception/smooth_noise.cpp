#include "perception/smooth_noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace dofusion {
namespace {

// A blur over so many nodes of a coarse grid hardly varies between two of them, so that interpolating loses 2 % of the
// variance; what is lost is put back on average.
constexpr double kNodesPerLength = 3.0;
constexpr double kLostByInterpolation = 0.982;
constexpr double kFarthest = 3.0;  // standard deviations that the blur reaches

// Weights of a Gaussian blur with a standard deviation of `length` nodes; their squares sum to 1, so that white noise
// keeps its variance.
std::vector<float> blur_weights(double length) {
  const int reach = std::max(1, static_cast<int>(std::ceil(kFarthest * length)));
  std::vector<float> weights;
  double squares = 0.0;
  for (int k = -reach; k <= reach; ++k) {
    const double weight = std::exp(-0.5 * k * k / (length * length));
    weights.push_back(static_cast<float>(weight));
    squares += weight * weight;
  }
  for (float& weight : weights) weight /= static_cast<float>(std::sqrt(squares));
  return weights;
}

// The blurred image where the weights lie inside of it, first along the rows, then along the columns.
Image<float> blurred(const Image<float>& noise, const std::vector<float>& weights) {
  const int reach = static_cast<int>(weights.size()) - 1;
  Image<float> rows(noise.width - reach, noise.height, 0.0F);
  for (int v = 0; v < rows.height; ++v)
    for (int k = 0; k <= reach; ++k)
      for (int u = 0; u < rows.width; ++u) rows.at(v, u) += weights[k] * noise.at(v, u + k);
  Image<float> both(rows.width, noise.height - reach, 0.0F);
  for (int v = 0; v < both.height; ++v)
    for (int k = 0; k <= reach; ++k)
      for (int u = 0; u < both.width; ++u) both.at(v, u) += weights[k] * rows.at(v + k, u);
  return both;
}

Image<float> white_noise(int width, int height, Rng& rng) {
  Image<float> noise(width, height);
  std::normal_distribution<float> normal;
  for (float& value : noise.pixels) value = normal(rng);
  return noise;
}

}  // namespace

Image<float> smooth_noise(int width, int height, double length_px, Rng& rng) {
  if (!(length_px >= 0.0 && length_px <= 1e4))
    throw std::invalid_argument("the length of smooth noise must lie in [0, 10000] pixels, not " +
                                std::to_string(length_px));
  if (length_px == 0.0) return white_noise(width, height, rng);
  const double spacing = std::max(1.0, length_px / kNodesPerLength);  // pixels between nodes
  const std::vector<float> weights = blur_weights(length_px / spacing);
  const int margin = static_cast<int>(weights.size()) - 1;
  const int columns = static_cast<int>((width - 1) / spacing) + 2, rows = static_cast<int>((height - 1) / spacing) + 2;
  const Image<float> nodes = blurred(white_noise(columns + margin, rows + margin, rng), weights);
  const auto gain = static_cast<float>(spacing > 1.0 ? 1.0 / std::sqrt(kLostByInterpolation) : 1.0);
  Image<float> noise(width, height);
  for (int v = 0; v < height; ++v) {
    const double y = v / spacing;
    const int row = static_cast<int>(y);
    const auto down = static_cast<float>(y - row);
    for (int u = 0; u < width; ++u) {
      const double x = u / spacing;
      const int column = static_cast<int>(x);
      const auto right = static_cast<float>(x - column);
      const float above = nodes.at(row, column) * (1.0F - right) + nodes.at(row, column + 1) * right;
      const float below = nodes.at(row + 1, column) * (1.0F - right) + nodes.at(row + 1, column + 1) * right;
      noise.at(v, u) = gain * (above * (1.0F - down) + below * down);
    }
  }
  return noise;
}

double normal_exceedance(double share) {
  if (share <= 0.0) return std::numeric_limits<double>::infinity();
  if (share >= 1.0) return -std::numeric_limits<double>::infinity();
  double low = -40.0, high = 40.0;  // the tail falls from one to the other
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(middle / std::sqrt(2.0)) > share ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace dofusion
