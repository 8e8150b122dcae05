#include <cfloat>

#include <immintrin.h>

#include "perception/triangle_tree.h"

namespace dofusion {
namespace {
#include "perception/triangle_tree_impl.h"
}  // namespace

NearestTriangle nearest_avx2(const TreeArrays& tree, const double point[3], int start);
NearestTriangle nearest_avx2(const TreeArrays& tree, const double point[3], int start) {
  return search(tree, point, start);
}

}  // namespace dofusion
