#include "stability/triangle_tree.h"

#include <algorithm>

namespace dofusion {
namespace {

constexpr int kLeafTriangles = 4;

}  // namespace

TriangleTree::TriangleTree(const TriangleMesh& mesh) : triangles_(signed_triangles(mesh)) {
  nodes_.reserve(triangles_.size());
  build(0, static_cast<int>(triangles_.size()));
}

int TriangleTree::build(int first, int last) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  Node node;
  node.first = first;
  node.last = last;
  for (int i = first; i < last; ++i) {
    const SignedTriangle& t = triangles_[static_cast<std::size_t>(i)];
    node.box.extend(t.a).extend(t.b).extend(t.c);
  }
  if (last - first > kLeafTriangles) {
    Eigen::Index axis = 0;
    node.box.sizes().maxCoeff(&axis);
    const int middle = first + (last - first) / 2;
    const auto along = [axis](const SignedTriangle& t) { return t.a[axis] + t.b[axis] + t.c[axis]; };
    std::nth_element(triangles_.begin() + first, triangles_.begin() + middle, triangles_.begin() + last,
                     [&](const SignedTriangle& s, const SignedTriangle& t) { return along(s) < along(t); });
    node.left = build(first, middle);
    node.right = build(middle, last);
  }
  nodes_[static_cast<std::size_t>(index)] = node;
  return index;
}

bool TriangleTree::any_within(const Eigen::Vector3d& point, double distance) const {
  const double squared = distance * distance;
  std::vector<int> open{0};
  while (!open.empty()) {
    const Node& node = nodes_[static_cast<std::size_t>(open.back())];
    open.pop_back();
    if (node.box.squaredExteriorDistance(point) > squared) continue;
    if (node.left >= 0) {
      open.push_back(node.left);
      open.push_back(node.right);
      continue;
    }
    for (int i = node.first; i < node.last; ++i) {
      if (distance_to_triangle(triangles_[static_cast<std::size_t>(i)], point).squared <= squared) return true;
    }
  }
  return false;
}

}  // namespace dofusion
