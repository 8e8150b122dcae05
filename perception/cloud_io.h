// Point clouds from PCD and PLY files.
#pragma once

#include <string>

#include "perception/camera.h"
#include "perception/image.h"

namespace dofusion {

// The depth image of a cloud given in the camera's frame (x right, y down, z forward, metres): each point goes to the
// pixel that it projects to, the nearest point of a pixel counts. Points that are not finite, behind the camera or
// outside the image are left out; a cloud sparser than the image leaves pixels without a reading. Throws InputError
// naming the file if it is missing, neither .pcd nor .ply, damaged, or without a point in the image. A child process runs
// PCL, which crashes on some damaged files: within 2 s of processor time and 2 s more for every megabyte.
DepthImage read_cloud_as_depth(const std::string& path, const Camera& camera);

}  // namespace dofusion
