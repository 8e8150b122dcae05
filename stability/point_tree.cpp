#include "stability/point_tree.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>

namespace dofusion {
namespace {

constexpr int kPointsInALeaf = 16;

}  // namespace

PointTree::PointTree(std::vector<Eigen::Vector3d> points) : points_(std::move(points)) {
  double largest = 0.0;
  for (const Eigen::Vector3d& p : points_) largest = std::max(largest, p.cwiseAbs().maxCoeff());
  rounding_ = 1e-14 * largest;
  if (!points_.empty()) build(0, static_cast<int>(points_.size()));
}

int PointTree::build(int first, int last) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int i = first; i < last; ++i) mean += points_[i];
  mean /= last - first;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (int i = first; i < last; ++i) {
    const Eigen::Vector3d d = points_[i] - mean;
    covariance.noalias() += d * d.transpose();
  }
  Node node;
  node.axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvectors();
  if (!node.axes.allFinite()) node.axes.setIdentity();  // squares that overflow
  Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY), high = -low;
  for (int i = first; i < last; ++i) {
    const Eigen::Vector3d q = node.axes.transpose() * (points_[i] - mean);
    low = low.cwiseMin(q);
    high = high.cwiseMax(q);
  }
  node.centre = mean + node.axes * (low + high) / 2.0;
  node.half_extents = (high - low) / 2.0 + Eigen::Vector3d::Constant(4.0 * rounding_);
  node.radius = node.half_extents.norm();
  node.first = first;
  node.last = last;
  const int index = static_cast<int>(nodes_.size());
  nodes_.push_back(node);
  if (last - first <= kPointsInALeaf || !node.half_extents.allFinite()) return index;

  int longest = 0;
  node.half_extents.maxCoeff(&longest);
  const Eigen::Vector3d along = node.axes.col(longest);
  const int middle = (first + last) / 2;
  std::nth_element(points_.begin() + first, points_.begin() + middle, points_.begin() + last,
                   [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return along.dot(a) < along.dot(b); });
  const int left = build(first, middle);
  const int right = build(middle, last);
  nodes_[index].left = left;
  nodes_[index].right = right;
  return index;
}

double PointTree::extent(const Node& node, const Eigen::Vector3d& direction) {
  return (node.axes.transpose() * direction).cwiseAbs().dot(node.half_extents);
}

bool PointTree::any_beyond(const Eigen::Vector3d& normal, double offset) const {
  std::vector<int> open;
  if (!nodes_.empty()) open.push_back(0);
  while (!open.empty()) {
    const Node& node = nodes_[open.back()];
    open.pop_back();
    if (normal.dot(node.centre) + extent(node, normal) <= offset) continue;
    if (node.left >= 0) {
      open.push_back(node.left);
      open.push_back(node.right);
      continue;
    }
    for (int i = node.first; i < node.last; ++i) {
      if (normal.dot(points_[i]) > offset) return true;
    }
  }
  return false;
}

// A distance between two points to prune with from the start: hops from one point to the farthest from it.
double PointTree::initial_diameter() const {
  double squared = 0.0;
  Eigen::Vector3d from = points_.front();
  for (int hop = 0; hop < 4; ++hop) {
    const auto farthest =
        std::max_element(points_.begin(), points_.end(), [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
          return (a - from).squaredNorm() < (b - from).squaredNorm();
        });
    const double found = (*farthest - from).squaredNorm();
    if (!(found > squared)) break;
    squared = found;
    from = *farthest;
  }
  return squared;
}

// An upper bound. Seen along the line of centres, points of the two boxes differ by at most the boxes' extents along
// it, and across it by at most the radii, which count at second order only.
double PointTree::longest_distance(const Node& a, const Node& b) const {
  const Eigen::Vector3d between = b.centre - a.centre;
  const double distance = between.norm();
  const double radii = a.radius + b.radius;
  if (!(distance > 0.0)) return radii;
  const Eigen::Vector3d direction = between / distance;
  const double along = distance + extent(a, direction) + extent(b, direction);
  return std::min(std::hypot(along, radii), distance + radii);
}

double PointTree::diameter() const {
  if (points_.size() < 2) return 0.0;
  double squared = initial_diameter();
  double best = std::sqrt(squared);
  struct Pair {
    int a, b;
    double bound;
  };
  const auto pair = [&](int a, int b) { return Pair{a, b, longest_distance(nodes_[a], nodes_[b]) + rounding_}; };
  std::vector<Pair> open = {pair(0, 0)};
  while (!open.empty()) {
    const Pair next = open.back();
    open.pop_back();
    if (next.bound <= best) continue;
    const Node &a = nodes_[next.a], &b = nodes_[next.b];
    if (a.left < 0 && b.left < 0) {
      for (int i = a.first; i < a.last; ++i) {
        for (int j = b.first; j < b.last; ++j) squared = std::max(squared, (points_[i] - points_[j]).squaredNorm());
      }
      best = std::sqrt(squared);
      continue;
    }
    const std::size_t from = open.size();
    if (next.a == next.b) {
      open.insert(open.end(), {pair(a.left, a.left), pair(a.right, a.right), pair(a.left, a.right)});
    } else if (b.left < 0 || (a.left >= 0 && a.radius >= b.radius)) {
      open.insert(open.end(), {pair(a.left, next.b), pair(a.right, next.b)});
    } else {
      open.insert(open.end(), {pair(next.a, b.left), pair(next.a, b.right)});
    }
    // The most promising pair is looked at next: it raises what the others are pruned with.
    std::sort(open.begin() + static_cast<std::ptrdiff_t>(from), open.end(),
              [](const Pair& x, const Pair& y) { return x.bound < y.bound; });
  }
  return best;
}

}  // namespace dofusion
