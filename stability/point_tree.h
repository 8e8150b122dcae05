// A tree of oriented boxes over points: exact answers about very many of them without looking at every pair.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace dofusion {

// Boxes follow the points' principal axes, so that flat and curved surfaces are bounded tightly whatever their
// direction. n points take O(n log n) to build.
class PointTree {
 public:
  explicit PointTree(std::vector<Eigen::Vector3d> points);

  // The largest distance between two points, the same number that trying all pairs gives; 0 for fewer than two.
  double diameter() const;

  // Some point p has normal · p > offset.
  bool any_beyond(const Eigen::Vector3d& normal, double offset) const;

 private:
  struct Node {
    Eigen::Vector3d centre;
    Eigen::Matrix3d axes;          // columns, orthonormal
    Eigen::Vector3d half_extents;  // along the axes
    double radius = 0.0;           // of a sphere about the centre that holds the box
    int first = 0, last = 0;       // points [first, last)
    int left = -1, right = -1;     // nodes; -1 in a leaf
  };

  int build(int first, int last);
  double initial_diameter() const;
  double longest_distance(const Node& a, const Node& b) const;
  static double extent(const Node& node, const Eigen::Vector3d& direction);

  std::vector<Eigen::Vector3d> points_;  // in the order of the leaves
  std::vector<Node> nodes_;              // the first is the root
  double rounding_ = 0.0;                // metres that a bound may be off by
};

}  // namespace dofusion
