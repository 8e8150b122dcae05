#include "perception/triangle_tree.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <stdexcept>

#include <Eigen/Geometry>

namespace dofusion {
namespace {

using Box = Eigen::AlignedBox3d;

struct Range {
  int first = 0, last = 0;  // in the order of triangles
  Box box;                  // of the triangles
  int size() const { return last - first; }
};

double half_area(const Box& box) {
  if (box.isEmpty()) return 0.0;
  const Eigen::Vector3d e = box.sizes();
  return e.x() * e.y() + e.y() * e.z() + e.z() * e.x();
}

class Builder {
 public:
  explicit Builder(const TriangleMesh& mesh) : mesh_(mesh), order_(mesh.triangles.size()) {
    if (order_.empty()) throw std::invalid_argument("a tree of no triangles");
    std::iota(order_.begin(), order_.end(), 0);
    for (const Eigen::Vector3i& t : mesh.triangles) {
      Box box;
      for (int k = 0; k < 3; ++k) box.extend(mesh.vertices[t[k]]);
      boxes_.push_back(box);
      tree_.half_size = std::max(tree_.half_size, box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff());
    }
  }

  TriangleTree build() {
    add_node(whole(), 0);
    return std::move(tree_);
  }

 private:
  Range whole() const {
    Range range{0, static_cast<int>(order_.size()), {}};
    for (const Box& box : boxes_) range.box.extend(box);
    return range;
  }

  // The children of a node: the range, cut again and again where its largest part is cheapest to cut.
  std::vector<Range> parts_of(const Range& range, int depth) {
    std::vector<Range> parts{range};
    while (static_cast<int>(parts.size()) < kTreeLanes) {
      const auto larger = [](const Range& r, const Range& s) {
        const auto size = [](const Range& x) { return x.size() > kTreeLanes ? half_area(x.box) : -1.0; };
        return size(r) < size(s);
      };
      const auto largest = std::max_element(parts.begin(), parts.end(), larger);
      if (largest->size() <= kTreeLanes) break;
      const int middle = cut(*largest, depth);
      const Range left = boxed(largest->first, middle), right = boxed(middle, largest->last);
      *largest = left;
      parts.push_back(right);
    }
    return parts;
  }

  Range boxed(int first, int last) const {
    Range range{first, last, {}};
    for (int i = first; i < last; ++i) range.box.extend(boxes_[order_[i]]);
    return range;
  }

  // Parts the range by the surface area heuristic over bins (Wald 2007), counted in packets; in the middle if the
  // centres do not differ or the tree grows deep.
  int cut(const Range& range, int depth) {
    constexpr int kBins = 16, kDeep = 24;
    Box centres;
    for (int i = range.first; i < range.last; ++i) centres.extend(boxes_[order_[i]].center());
    int best_axis = -1, best_bin = 0;
    double best_cost = std::numeric_limits<double>::infinity();
    const Eigen::Vector3d extent = centres.sizes();
    const auto bin_of = [&](int triangle, int axis) {
      const double share = (boxes_[triangle].center()[axis] - centres.min()[axis]) / extent[axis];
      return std::min(kBins - 1, static_cast<int>(share * kBins));
    };
    for (int axis = 0; axis < 3 && depth < kDeep; ++axis) {
      if (!(extent[axis] > 0.0)) continue;
      std::array<Box, kBins> boxes;
      std::array<int, kBins> counts{};
      for (int i = range.first; i < range.last; ++i) {
        const int bin = bin_of(order_[i], axis);
        boxes[bin].extend(boxes_[order_[i]]);
        ++counts[bin];
      }
      std::array<double, kBins> right_cost{};
      Box box;
      int count = 0;
      for (int b = kBins - 1; b > 0; --b) {
        box.extend(boxes[b]);
        count += counts[b];
        right_cost[b] = count == 0 ? std::numeric_limits<double>::infinity() : cost(box, count);
      }
      box = Box();
      count = 0;
      for (int b = 0; b + 1 < kBins; ++b) {
        box.extend(boxes[b]);
        count += counts[b];
        if (count == 0) continue;
        const double sum = cost(box, count) + right_cost[b + 1];
        if (!(sum < best_cost)) continue;
        best_cost = sum;
        best_axis = axis;
        best_bin = b;
      }
    }
    const auto first = order_.begin() + range.first, last = order_.begin() + range.last;
    if (best_axis >= 0) {
      const auto middle =
          std::partition(first, last, [&](int triangle) { return bin_of(triangle, best_axis) <= best_bin; });
      return static_cast<int>(middle - order_.begin());
    }
    int axis = 0;
    extent.maxCoeff(&axis);
    const int middle = range.first + range.size() / 2;
    std::nth_element(first, order_.begin() + middle, last, [&](int i, int j) {
      const double ci = boxes_[i].center()[axis], cj = boxes_[j].center()[axis];
      return ci < cj || (ci == cj && i < j);
    });
    return middle;
  }

  static double cost(const Box& box, int count) {
    return half_area(box) * ((count + kTreeLanes - 1) / kTreeLanes);  // NOLINT: whole packets
  }

  int add_node(const Range& range, int depth) {
    const std::vector<Range> parts = parts_of(range, depth);
    const int index = static_cast<int>(tree_.nodes.size());
    tree_.nodes.emplace_back();
    TreeNode node;
    for (int lane = 0; lane < kTreeLanes; ++lane) {
      const bool there = lane < static_cast<int>(parts.size());
      for (int k = 0; k < 3; ++k) {
        constexpr float kFar = std::numeric_limits<float>::max();
        node.low[k][lane] = there ? std::nextafter(static_cast<float>(parts[lane].box.min()[k]), -kFar) : kFar;
        node.high[k][lane] = there ? std::nextafter(static_cast<float>(parts[lane].box.max()[k]), kFar) : kFar;
      }
      if (!there) {
        node.child[lane] = kNoChild;
      } else if (parts[lane].size() <= kTreeLanes) {
        node.child[lane] = ~add_packet(parts[lane]);
      } else {
        node.child[lane] = add_node(parts[lane], depth + 1);
      }
    }
    tree_.nodes[index] = node;
    return index;
  }

  int add_packet(const Range& range) {
    const int index = static_cast<int>(tree_.packets.size());
    TrianglePacket packet;
    std::memset(&packet, 0, sizeof packet);
    for (int lane = 0; lane < kTreeLanes; ++lane) {
      if (lane >= range.size()) {
        for (int k = 0; k < 3; ++k) packet.a[k][lane] = std::numeric_limits<float>::max();
        for (int k = 0; k < 3; ++k) packet.z[k][lane] = 1.0F;
        tree_.exact.emplace_back();
        tree_.triangle.push_back(-1);
        continue;
      }
      const int triangle = order_[range.first + lane];
      set_lane(packet, lane, mesh_.triangles[triangle]);
      tree_.triangle.push_back(triangle);
    }
    tree_.packets.push_back(packet);
    return index;
  }

  void set_lane(TrianglePacket& packet, int lane, const Eigen::Vector3i& t) {
    const Eigen::Vector3d a = mesh_.vertices[t[0]], ab = mesh_.vertices[t[1]] - a, ac = mesh_.vertices[t[2]] - a;
    // A triangle without area has axes all the same: its sides are still where they are.
    const Eigen::Vector3d x = ab.norm() > 0.0 ? ab.normalized() : Eigen::Vector3d(Eigen::Vector3d::UnitX());
    Eigen::Vector3d z = ab.cross(ac);
    z = z.norm() > 0.0 ? z.normalized() : x.unitOrthogonal();
    const Eigen::Vector3d y = z.cross(x);
    ExactTriangle exact;
    for (int k = 0; k < 3; ++k) {
      packet.a[k][lane] = static_cast<float>(a[k]);
      packet.x[k][lane] = static_cast<float>(x[k]);
      packet.y[k][lane] = static_cast<float>(y[k]);
      packet.z[k][lane] = static_cast<float>(z[k]);
      exact.a[k] = a[k];
      exact.ab[k] = ab[k];
      exact.ac[k] = ac[k];
    }
    tree_.exact.push_back(exact);
    packet.b[lane] = static_cast<float>(ab.norm());
    packet.cx[lane] = static_cast<float>(x.dot(ac));
    packet.cy[lane] = static_cast<float>(y.dot(ac));
    const auto inverse = [](double square) { return square > 1e-37 ? static_cast<float>(1.0 / square) : 0.0F; };
    packet.bc_inverse_square[lane] = inverse((ac - ab).squaredNorm());
    packet.ca_inverse_square[lane] = inverse(ac.squaredNorm());
  }

  const TriangleMesh& mesh_;
  std::vector<int> order_;
  std::vector<Box> boxes_;  // per triangle
  TriangleTree tree_;
};

}  // namespace

NearestTriangle nearest_generic(const TreeArrays& tree, const double point[3], int start);
#if defined(__x86_64__)
NearestTriangle nearest_avx2(const TreeArrays& tree, const double point[3], int start);
#endif

TriangleTree make_triangle_tree(const TriangleMesh& mesh) { return Builder(mesh).build(); }

NearestFunction nearest_function(const char* name) {
#if defined(__x86_64__)
  if (!std::strcmp(name, "avx2"))
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? nearest_avx2 : nullptr;
#endif
  return std::strcmp(name, "generic") ? nullptr : nearest_generic;
}

NearestFunction best_nearest_function() {
  static const NearestFunction chosen = nearest_function("avx2") ? nearest_function("avx2") : nearest_generic;
  return chosen;
}

}  // namespace dofusion
