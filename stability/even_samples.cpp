#include "stability/even_samples.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <queue>

namespace dofusion {
namespace {

struct Neighbour {
  int sample;
  float weight;
};

// Per sample those within a radius: those of sample i are `all[start[i]]` … before `all[start[i + 1]]`.
struct Neighbours {
  std::vector<int> start;
  std::vector<Neighbour> all;
};

// How much a sample speaks against another at this distance; Yuksel's w, with alpha = 8.
float weight_of(double distance, double radius) {
  const double w = 1.0 - distance / radius, w2 = w * w, w4 = w2 * w2;
  return static_cast<float>(w4 * w4);
}

// Samples in cubic cells of a grid, sorted by cell.
class Cells {
 public:
  Cells(const std::vector<SurfaceSample>& samples, double size) : samples_(samples), size_(size) {
    origin_ = samples.front().point;
    Eigen::Vector3d top = origin_;
    for (const SurfaceSample& s : samples) {
      origin_ = origin_.cwiseMin(s.point);
      top = top.cwiseMax(s.point);
    }
    for (int k = 0; k < 3; ++k) counts_[k] = 1 + static_cast<std::int64_t>((top[k] - origin_[k]) / size);
    for (std::size_t i = 0; i < samples.size(); ++i)
      entries_.push_back({key_of(cell_of(samples[i].point)), static_cast<int>(i)});
    std::sort(entries_.begin(), entries_.end(),
              [](const Entry& a, const Entry& b) { return a.key < b.key || (a.key == b.key && a.sample < b.sample); });
  }

  // visit(sample) for all in the cells around a point.
  template <typename Visit>
  void around(const Eigen::Vector3d& point, const Visit& visit) const {
    const Cell centre = cell_of(point);
    const std::int64_t x_low = std::max<std::int64_t>(0, centre.x - 1);
    const std::int64_t x_high = std::min(counts_[0] - 1, centre.x + 1);
    for (std::int64_t z = centre.z - 1; z <= centre.z + 1; ++z) {
      for (std::int64_t y = centre.y - 1; y <= centre.y + 1; ++y) {
        if (y < 0 || z < 0 || y >= counts_[1] || z >= counts_[2]) continue;
        const std::int64_t last = key_of({x_high, y, z});  // cells in a row along x have keys in a row
        auto entry = std::lower_bound(entries_.begin(), entries_.end(), key_of({x_low, y, z}),
                                      [](const Entry& e, std::int64_t key) { return e.key < key; });
        for (; entry != entries_.end() && entry->key <= last; ++entry) visit(entry->sample);
      }
    }
  }

 private:
  struct Cell {
    std::int64_t x, y, z;
  };
  struct Entry {
    std::int64_t key;
    int sample;
  };
  Cell cell_of(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d q = (p - origin_) / size_;
    return {static_cast<std::int64_t>(q.x()), static_cast<std::int64_t>(q.y()), static_cast<std::int64_t>(q.z())};
  }
  std::int64_t key_of(const Cell& c) const { return c.x + counts_[0] * (c.y + counts_[1] * c.z); }

  const std::vector<SurfaceSample>& samples_;
  double size_;
  Eigen::Vector3d origin_;
  std::int64_t counts_[3];
  std::vector<Entry> entries_;
};

Neighbours neighbours_within(const std::vector<SurfaceSample>& samples, double radius) {
  const Cells cells(samples, radius);
  Neighbours neighbours;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    neighbours.start.push_back(static_cast<int>(neighbours.all.size()));
    cells.around(samples[i].point, [&](int j) {
      const double square = (samples[j].point - samples[i].point).squaredNorm();
      if (j == static_cast<int>(i) || !(square < radius * radius)) return;
      neighbours.all.push_back({j, weight_of(std::sqrt(square), radius)});
    });
  }
  neighbours.start.push_back(static_cast<int>(neighbours.all.size()));
  return neighbours;
}

struct Crowded {
  float weight;
  int sample;
  bool operator<(const Crowded& other) const {
    return weight < other.weight || (weight == other.weight && sample < other.sample);
  }
};

// Which samples remain when the most crowded one goes, again and again. Weights only fall, so that one on the heap that
// is out of date comes up too early, never too late, and goes back with what it is now.
std::vector<bool> eliminate(const Neighbours& neighbours, int samples, int remaining) {
  std::vector<float> weight(static_cast<std::size_t>(samples), 0.0F);
  std::vector<Crowded> all;
  for (int i = 0; i < samples; ++i) {
    for (int n = neighbours.start[i]; n < neighbours.start[i + 1]; ++n) weight[i] += neighbours.all[n].weight;
    all.push_back({weight[i], i});
  }
  std::priority_queue<Crowded> heap(std::less<Crowded>(), std::move(all));
  std::vector<bool> stays(static_cast<std::size_t>(samples), true);
  for (int left = samples; left > remaining;) {
    const Crowded top = heap.top();
    heap.pop();
    if (top.weight != weight[top.sample]) {
      heap.push({weight[top.sample], top.sample});
      continue;
    }
    stays[top.sample] = false;
    --left;
    for (int n = neighbours.start[top.sample]; n < neighbours.start[top.sample + 1]; ++n)
      weight[neighbours.all[n].sample] -= neighbours.all[n].weight;
  }
  return stays;
}

}  // namespace

double densest_spacing(double area, int count) { return std::sqrt(2.0 * area / (std::sqrt(3.0) * count)); }

std::vector<SurfaceSample> sample_surface_evenly(const TriangleMesh& mesh, int count, Rng& rng) {
  constexpr int kCandidates = 5;  // per point; Yuksel's choice
  if (count <= 0) return {};
  const std::vector<SurfaceSample> candidates = sample_surface(mesh, kCandidates * count, rng);
  // Yuksel's 2 r_max, where r_max is half the densest spacing.
  const double radius = densest_spacing(surface_area(mesh), count);
  const std::vector<bool> stays =
      eliminate(neighbours_within(candidates, radius), static_cast<int>(candidates.size()), count);
  std::vector<SurfaceSample> samples;
  samples.reserve(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < candidates.size(); ++i)
    if (stays[i]) samples.push_back(candidates[i]);
  return samples;
}

}  // namespace dofusion
