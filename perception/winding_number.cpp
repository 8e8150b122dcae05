#include "perception/winding_number.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace dofusion {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kFar = 3.0;  // radii from the centre; the dipole's error falls with the square

using ConstVector = Eigen::Map<const Eigen::Vector3d>;

struct Moments {
  Eigen::Vector3d area = Eigen::Vector3d::Zero(), weighted_centre = Eigen::Vector3d::Zero();
  double weight = 0.0;

  void add(const ExactTriangle& t) {
    const ConstVector a(t.a), ab(t.ab), ac(t.ac);
    const Eigen::Vector3d area_vector = 0.5 * ab.cross(ac);
    const double size = area_vector.norm();
    area += area_vector;
    weighted_centre += size * (a + (ab + ac) / 3.0);
    weight += size;
  }
  void add(const Moments& other) {
    area += other.area;
    weighted_centre += other.weighted_centre;
    weight += other.weight;
  }
};

// Van Oosterom and Strackee 1983.
double solid_angle(const ExactTriangle& t, const Eigen::Vector3d& p) {
  const Eigen::Vector3d a = ConstVector(t.a) - p, b = a + ConstVector(t.ab), c = a + ConstVector(t.ac);
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

std::vector<NodeDipoles> make_dipoles(const TriangleTree& tree) {
  std::vector<NodeDipoles> dipoles(tree.nodes.size());
  std::vector<Moments> of_node(tree.nodes.size());
  for (int n = static_cast<int>(tree.nodes.size()) - 1; n >= 0; --n) {  // children come after their parents
    const TreeNode& node = tree.nodes[n];
    for (int lane = 0; lane < kTreeLanes; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      Moments moments;
      if (node.child[lane] >= 0) {
        moments = of_node[node.child[lane]];
      } else {
        for (int i = 0; i < kTreeLanes; ++i) {
          const int slot = kTreeLanes * ~node.child[lane] + i;
          if (tree.triangle[slot] >= 0) moments.add(tree.exact[slot]);
        }
      }
      of_node[n].add(moments);
      Eigen::Vector3d low, high;
      for (int k = 0; k < 3; ++k) low[k] = node.low[k][lane], high[k] = node.high[k][lane];
      Dipole& dipole = dipoles[n][lane];
      dipole.area = moments.area;
      dipole.centre = moments.weight > 0.0 ? Eigen::Vector3d(moments.weighted_centre / moments.weight)
                                           : Eigen::Vector3d((low + high) / 2.0);
      dipole.radius = (dipole.centre - low).cwiseAbs().cwiseMax((high - dipole.centre).cwiseAbs()).norm();
    }
  }
  return dipoles;
}

double winding_number(const TriangleTree& tree, const std::vector<NodeDipoles>& dipoles, const Eigen::Vector3d& point) {
  double angle = 0.0;
  std::vector<int> pending{0};
  while (!pending.empty()) {
    const int n = pending.back();
    pending.pop_back();
    for (int lane = 0; lane < kTreeLanes; ++lane) {
      const std::int32_t child = tree.nodes[n].child[lane];
      if (child == kNoChild) continue;
      const Dipole& dipole = dipoles[n][lane];
      const Eigen::Vector3d to_centre = dipole.centre - point;
      const double distance = to_centre.norm();
      if (distance > kFar * dipole.radius) {
        angle += dipole.area.dot(to_centre) / (distance * distance * distance);
      } else if (child >= 0) {
        pending.push_back(child);
      } else {
        for (int i = 0; i < kTreeLanes; ++i) {
          const int slot = kTreeLanes * ~child + i;
          if (tree.triangle[slot] >= 0) angle += solid_angle(tree.exact[slot], point);
        }
      }
    }
  }
  return angle / (4.0 * kPi);
}

}  // namespace dofusion
