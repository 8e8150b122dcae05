#include "perception/winding_number.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>

namespace dofusion {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kFar = 3.0;  // radii from the centre; a dipole's error falls with the square
constexpr int kLeaf = 8;      // triangles

// Van Oosterom and Strackee 1983; a, b, c relative to the point.
double solid_angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

WindingNumber::WindingNumber(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) throw std::invalid_argument("the winding number of a mesh without triangles");
  for (const Eigen::Vector3i& t : mesh.triangles)
    triangles_.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
  add_node(0, static_cast<int>(triangles_.size()));
}

int WindingNumber::add_node(int first, int last) {
  Node node;
  node.first = first;
  node.last = last;
  double weight = 0.0;
  Eigen::AlignedBox3d centres;
  for (int i = first; i < last; ++i) {
    const Triangle& t = triangles_[i];
    const Eigen::Vector3d area = 0.5 * (t.b - t.a).cross(t.c - t.a);
    node.area += area;
    node.centre += area.norm() * t.centre();
    weight += area.norm();
    centres.extend(t.centre());
  }
  node.centre = weight > 0.0 ? Eigen::Vector3d(node.centre / weight) : centres.center();
  for (int i = first; i < last; ++i)
    for (const Eigen::Vector3d* corner : {&triangles_[i].a, &triangles_[i].b, &triangles_[i].c})
      node.radius = std::max(node.radius, (*corner - node.centre).norm());
  const int index = static_cast<int>(nodes_.size());
  nodes_.push_back(node);
  if (last - first <= kLeaf) return index;

  int axis = 0;
  centres.sizes().maxCoeff(&axis);
  const int middle = first + (last - first) / 2;
  std::nth_element(triangles_.begin() + first, triangles_.begin() + middle, triangles_.begin() + last,
                   [axis](const Triangle& s, const Triangle& t) { return s.centre()[axis] < t.centre()[axis]; });
  add_node(first, middle);
  const int second = add_node(middle, last);
  nodes_[index].second_child = second;
  return index;
}

double WindingNumber::operator()(const Eigen::Vector3d& point) const {
  double angle = 0.0;
  int pending[64];  // halves of halves: one of 64 would be of 2^64 triangles
  int count = 0;
  for (int index = 0; index >= 0; index = count > 0 ? pending[--count] : -1) {
    const Node* node = &nodes_[index];
    while (true) {
      const Eigen::Vector3d to_centre = node->centre - point;
      const double distance = to_centre.norm();
      if (distance > kFar * node->radius) {
        angle += node->area.dot(to_centre) / (distance * distance * distance);
        break;
      }
      if (node->second_child < 0) {
        for (int i = node->first; i < node->last; ++i)
          angle += solid_angle(triangles_[i].a - point, triangles_[i].b - point, triangles_[i].c - point);
        break;
      }
      pending[count++] = node->second_child;
      ++node;
    }
  }
  return angle / (4.0 * kPi);
}

}  // namespace dofusion
