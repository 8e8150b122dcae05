// A bounding volume hierarchy over triangles that finds the nearest one, eight boxes or eight triangles at a time.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "stability/mesh.h"

namespace dofusion {

inline constexpr int kTreeLanes = 8;
inline constexpr std::int32_t kNoChild = std::numeric_limits<std::int32_t>::min();

// Up to eight children: a child >= 0 is a node, one below is the packet ~child. Lanes without a child have a box that
// is infinitely far. Boxes are rounded outwards.
struct alignas(32) TreeNode {
  float low[3][kTreeLanes], high[3][kTreeLanes];
  std::int32_t child[kTreeLanes];
};

// Up to eight triangles, each with corner a, and axes x (along ab), y and z (its normal), in which it is (0, 0),
// (b, 0), (cx, cy). Lanes without a triangle are infinitely far.
struct alignas(32) TrianglePacket {
  float a[3][kTreeLanes], x[3][kTreeLanes], y[3][kTreeLanes], z[3][kTreeLanes];
  float b[kTreeLanes], cx[kTreeLanes], cy[kTreeLanes];
  float bc_inverse_square[kTreeLanes], ca_inverse_square[kTreeLanes];  // of these sides' lengths; 0 for a length of 0
};

// a, b - a, c - a.
struct ExactTriangle {
  double a[3], ab[3], ac[3];
};

// Triangle i of packet p is at slot 8 p + i.
struct TriangleTree {
  std::vector<TreeNode> nodes;  // the first is the root
  std::vector<TrianglePacket> packets;
  std::vector<ExactTriangle> exact;  // per slot
  std::vector<int> triangle;         // per slot, of the mesh; -1: none
  double half_size = 0.0;            // the largest coordinate of the mesh
};

// The tree as plain arrays, all that the search needs.
struct TreeArrays {
  const TreeNode* nodes;
  const TrianglePacket* packets;
  const ExactTriangle* exact;
  double half_size;
};
inline TreeArrays arrays_of(const TriangleTree& tree) {
  return {tree.nodes.data(), tree.packets.data(), tree.exact.data(), tree.half_size};
}

// Throws std::invalid_argument without triangles. Coordinates become floats, so the mesh should lie about the origin.
TriangleTree make_triangle_tree(const TriangleMesh& mesh);

struct NearestTriangle {
  int slot = -1;  // -1: none, as for a point that is not finite
  double squared = std::numeric_limits<double>::infinity();
};

// Finds the triangle that is nearest to the point, exactly: floats only rule out triangles and boxes that are farther
// by more than their error. `start` is the slot of a triangle that is likely near, as that of a point close by, or -1.
// Neither mesh nor point may have coordinates beyond kFarthestCoordinate, whose squares are no floats.
using NearestFunction = NearestTriangle (*)(const TreeArrays& tree, const double point[3], int start);
inline constexpr double kFarthestCoordinate = 1e18;

// "avx2" or "generic"; nullptr if this processor does not have it.
NearestFunction nearest_function(const char* name);
NearestFunction best_nearest_function();

}  // namespace dofusion
