// Which parts of a recovered mesh the cameras have seen.
#pragma once

#include <string>
#include <vector>

#include "perception/recovery.h"
#include "perception/views.h"

namespace dofusion {

// For each triangle of the object's mesh the share (0 … 1) of it that faces a camera and that a reading shows, to three
// sigmas of the view's table along the ray and `slack` (metres) across the surface; over several views the largest. 0:
// nobody has seen that it is there. The views' world is the object's (on_common_table()); their labels are not used.
std::vector<float> seen_shares(const RecoveredObject& object, const std::vector<View>& views, double slack = 0.002);

// Writes the mesh (metres) as an OBJ file in which triangles with a share above 0 have the material "seen", the others
// "never_seen", and those materials to the file beside it that ends in .mtl: loaders that know no materials, MuJoCo's
// among them, find the same mesh in it. Throws InputError naming the file that cannot be written, std::invalid_argument
// unless there is one share a triangle.
void write_seen_obj(const TriangleMesh& mesh, const std::vector<float>& shares, const std::string& path);

}  // namespace dofusion
