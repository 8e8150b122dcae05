#include <cfloat>

#include "perception/triangle_tree.h"

namespace dofusion {
namespace {
#include "perception/triangle_tree_impl.h"
}  // namespace

NearestTriangle nearest_generic(const TreeArrays& tree, const double point[3], int start);
NearestTriangle nearest_generic(const TreeArrays& tree, const double point[3], int start) {
  return search(tree, point, start);
}

}  // namespace dofusion
