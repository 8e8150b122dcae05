// Where lines along the x axis cross a closed mesh.
#pragma once

#include <vector>

#include "stability/mesh.h"

namespace dofusion {

struct RayCrossing {
  double x = 0.0;
  int change = 0;  // of the number of solids the line is in, walking towards +x: +1 where it enters, -1 where it leaves
};

// Triangles sorted into a grid over y-z. A line through an edge or a corner is counted as one that passes beside it, so
// that the changes along any line sum to 0. Memory O(T).
class MeshRays {
 public:
  explicit MeshRays(const TriangleMesh& mesh);  // throws std::invalid_argument without triangles

  // In order of x; empty where the line meets nothing.
  std::vector<RayCrossing> along_x(double y, double z) const;

  // Which side a point on the surface is on is arbitrary.
  bool inside(const Eigen::Vector3d& point) const;

 private:
  void sort_into_cells(int resolution);
  Eigen::Vector2i cell_of(const Eigen::Vector2d& yz) const;

  TriangleMesh mesh_;
  Eigen::Vector2d low_, cell_;  // y-z
  int resolution_ = 1;
  std::vector<std::size_t> start_;  // of the cell's triangles
  std::vector<int> triangles_;
};

}  // namespace dofusion
