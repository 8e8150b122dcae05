#include "perception/unexplained.h"

#include <algorithm>
#include <utility>

namespace dofusion {
namespace {

class PixelGroups {
 public:
  PixelGroups(const ClusterView& cluster, const Observation& seen, const ViewExplanation& scene)
      : cluster_(cluster), seen_(seen), scene_(scene) {
    open_ = Image<std::uint8_t>(seen.depth.width, seen.depth.height, 0);
    for (int v = 0; v < open_.height; ++v) {
      for (int u = 0; u < open_.width; ++u) open_.at(v, u) = is_unexplained(v, u);
    }
  }

  // Connected unexplained pixels with one label, as indices into the full image; the largest group.
  std::vector<int> largest() {
    std::vector<int> best;
    int most = 0;
    for (int v = 0; v < open_.height; ++v) {
      for (int u = 0; u < open_.width; ++u) {
        if (!open_.at(v, u)) continue;
        int core = 0;
        std::vector<int> group = flood(v, u, &core);
        if (core <= most) continue;
        most = core;
        best = std::move(group);
      }
    }
    core_of_largest_ = most;
    return best;
  }

  // Its pixels that lie well inside: slivers along outlines have none.
  int core_of_largest() const { return core_of_largest_; }

 private:
  bool is_unexplained(int v, int u) const {
    const std::vector<std::uint8_t>& others = cluster_.other_labels;
    const bool own = std::find(others.begin(), others.end(), seen_.labels.at(v, u)) == others.end();
    return own && seen_.depth.at(v, u) > 0.0f && seen_.depth.at(v, u) < scene_.depth.at(v, u) &&
           scene_.cost.at(v, u) >= 0.99f * kNearerCost;
  }

  int open_neighbours(int v, int u) const {
    int count = 0;
    for (int dv = -1; dv <= 1; ++dv) {
      for (int du = -1; du <= 1; ++du) {
        if ((dv != 0 || du != 0) && open_.contains(v + dv, u + du) && open_.at(v + dv, u + du) != 0) ++count;
      }
    }
    return count;
  }

  // Segmentation may have left out a part of an object, but parts with two labels are taken one at a time.
  static bool may_join(std::uint8_t a, std::uint8_t b) {
    return a == b || a < kLabelFirstObject || b < kLabelFirstObject;
  }

  std::vector<int> flood(int v0, int u0, int* core) {
    const LabelImage& labels = seen_.labels;
    std::vector<int> group;
    std::vector<std::pair<int, int>> stack = {{v0, u0}};
    std::vector<std::pair<int, int>> members;
    open_.at(v0, u0) = 2;
    while (!stack.empty()) {
      const auto [v, u] = stack.back();
      stack.pop_back();
      members.emplace_back(v, u);
      if (open_neighbours(v, u) >= 4) ++*core;
      for (int dv = -2; dv <= 2; ++dv) {
        for (int du = -2; du <= 2; ++du) {  // over gaps of one pixel: drop-outs
          if (!open_.contains(v + dv, u + du) || open_.at(v + dv, u + du) != 1) continue;
          if (!may_join(labels.at(v, u), labels.at(v + dv, u + du))) continue;
          open_.at(v + dv, u + du) = 2;
          stack.emplace_back(v + dv, u + du);
        }
      }
    }
    for (const auto& [v, u] : members) {
      group.push_back((cluster_.window.v0 + v) * cluster_.depth->width + cluster_.window.u0 + u);
      open_.at(v, u) = 0;
    }
    return group;
  }

  const ClusterView& cluster_;
  const Observation& seen_;
  const ViewExplanation& scene_;
  Image<std::uint8_t> open_;
  int core_of_largest_ = 0;
};

}  // namespace

std::optional<UnexplainedTarget> next_target(const Cluster& cluster, const Explanation& scene, int fewest_pixels) {
  std::vector<int> pixels;
  std::size_t best = 0;
  int most = fewest_pixels - 1;
  for (std::size_t i = 0; i < cluster.views.size(); ++i) {
    PixelGroups groups(cluster.views[i], cluster.pyramid.fine[i], scene[i]);
    std::vector<int> largest = groups.largest();
    if (groups.core_of_largest() <= most) continue;
    most = groups.core_of_largest();
    best = i;
    pixels = std::move(largest);
  }
  if (pixels.empty()) return std::nullopt;
  const ClusterView& view = cluster.views[best];
  return UnexplainedTarget{make_target(pixels, *view.depth, view.camera, view.T_world_camera, *view.face_map), best};
}

}  // namespace dofusion
