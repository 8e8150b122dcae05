// Which faces of a depth image belong to the same object.
#pragma once

#include <vector>

#include "perception/face_graph.h"
#include "perception/segmentation.h"

namespace dofusion {

// Per face the number of its object, 0, 1, …; -1 for the first face, which must be the table. Faces join over convex
// or smooth continuous edges as long as the result can be (nearly) convex, then over what hides them.
std::vector<int> join_faces(const FaceMap& map, const DepthImage& depth, const Camera& camera,
                            const SegmentationOptions& options);

}  // namespace dofusion
