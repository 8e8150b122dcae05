// How often a surface winds around a point: tells inside from outside where the surface has holes.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "stability/mesh.h"

namespace dofusion {

// The generalised winding number (Jacobson et al. 2013): the surface's solid angle over 4 pi. Of a closed surface 1
// inside and 0 outside; near a hole it passes smoothly from one to the other. By exact solid angles near by and dipoles
// from afar (Barill et al. 2018, first order): errs by less than 0.02, in about logarithmic time.
class WindingNumber {
 public:
  explicit WindingNumber(const TriangleMesh& mesh);  // throws std::invalid_argument without triangles
  double operator()(const Eigen::Vector3d& point) const;

 private:
  // Triangles that lie together, as one from afar. Those of a node that is no leaf are its two children's, the first of
  // which is the next node.
  struct Node {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // weighted by area
    Eigen::Vector3d area = Eigen::Vector3d::Zero();    // the sum of their area vectors, outward
    double radius = 0.0;                               // no corner is farther from the centre
    int first = 0, last = 0;                           // in triangles_
    int second_child = -1;                             // -1: a leaf
  };
  struct Triangle {
    Eigen::Vector3d a, b, c;
    Eigen::Vector3d centre() const { return (a + b + c) / 3.0; }
  };
  int add_node(int first, int last);

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace dofusion
