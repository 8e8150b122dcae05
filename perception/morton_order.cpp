#include "perception/morton_order.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dofusion {
namespace {

constexpr int kCells = 1024;

// Two zeros between each two of ten bits.
std::uint32_t spread(std::uint32_t x) {
  x = (x | (x << 16)) & 0x030000FFU;
  x = (x | (x << 8)) & 0x0300F00FU;
  x = (x | (x << 4)) & 0x030C30C3U;
  return (x | (x << 2)) & 0x09249249U;
}

struct Keyed {
  std::uint32_t key, index;
};

void radix_sort(std::vector<Keyed>& items) {
  constexpr int kBits = 10;
  std::vector<Keyed> sorted(items.size());
  for (int shift = 0; shift < 30; shift += kBits) {
    std::array<std::uint32_t, (1U << kBits) + 1> starts{};
    const auto digit = [shift](const Keyed& item) { return (item.key >> shift) & ((1U << kBits) - 1U); };
    for (const Keyed& item : items) ++starts[digit(item) + 1];
    for (std::size_t i = 1; i < starts.size(); ++i) starts[i] += starts[i - 1];
    for (const Keyed& item : items) sorted[starts[digit(item)]++] = item;
    items.swap(sorted);
  }
}

}  // namespace

std::vector<std::uint32_t> morton_order(const std::vector<Eigen::Vector3d>& points) {
  if (points.size() > std::numeric_limits<std::uint32_t>::max())
    throw std::invalid_argument("an order of more than 2^32 points");
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Eigen::Vector3d& p : points) {
    if (!p.allFinite()) continue;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double extent = points.empty() ? 0.0 : (high - low).maxCoeff();
  const double scale = extent > 0.0 ? kCells / extent : 0.0;
  const auto cell = [](double x) {
    return x >= 0.0 ? static_cast<std::uint32_t>(std::min(x, kCells - 1.0)) : 0U;  // NaN: 0
  };
  std::vector<Keyed> keyed(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d q = scale * (points[i] - low);
    keyed[i] = {spread(cell(q.x())) | (spread(cell(q.y())) << 1) | (spread(cell(q.z())) << 2),
                static_cast<std::uint32_t>(i)};
  }
  radix_sort(keyed);
  std::vector<std::uint32_t> order(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) order[i] = keyed[i].index;
  return order;
}

}  // namespace dofusion
