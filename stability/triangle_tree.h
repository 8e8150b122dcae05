// A tree of boxes over triangles: is anything of a surface near a point?
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "stability/mesh.h"
#include "stability/signed_triangles.h"

namespace dofusion {

// n triangles take O(n log n) to build; a question takes O(log n) where the surface is not everywhere near.
class TriangleTree {
 public:
  // Throws std::invalid_argument without triangles.
  explicit TriangleTree(const TriangleMesh& mesh);

  // Some point of the surface lies within `distance` of `point`, both in metres.
  bool any_within(const Eigen::Vector3d& point, double distance) const;

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int first = 0, last = 0;    // triangles [first, last)
    int left = -1, right = -1;  // nodes; -1 in a leaf
  };

  int build(int first, int last);

  std::vector<SignedTriangle> triangles_;  // in the order of the leaves
  std::vector<Node> nodes_;                // the first is the root
};

}  // namespace dofusion
