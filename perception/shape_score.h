// How well a convex shape agrees with depth images.
#pragma once

#include "perception/shape_fit.h"

namespace dofusion {

// 1 - mean squared distance of the object's readings to the shape's surface, in tolerances and at most 1 each, less
// the number of pixels (as a share of the object's) of all images whose reading lies behind the shape.
double score_shape(const TriangleMesh& mesh, const ObjectView& view, const ShapeEvidence& evidence, double slack);

}  // namespace dofusion
