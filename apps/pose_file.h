// Poses as JSON files: a 4 x 4 matrix by rows, by itself or under a name.
#pragma once

#include <string>
#include <vector>

#include "stability/pose.h"

namespace dofusion {

struct NamedPose {
  std::string name;  // the key it stood under; empty if the file is the matrix itself
  Pose pose = Pose::Identity();
};

// Reads [[…], …] or {"NAME": [[…], …]} with one of `names`; lengths in metres. A rotation that is off by rounding is
// made exact. Throws InputError naming the file and what is wrong, such as a matrix that is no rigid motion.
NamedPose read_pose(const std::string& path, const std::vector<std::string>& names);

}  // namespace dofusion
