// 16-bit depth images and 8-bit label images as PNG files.
#pragma once

#include <string>

#include "perception/camera.h"
#include "perception/image.h"

namespace dofusion {

// Throws InputError naming the file if it is missing, truncated, not 16 bit with one channel, or of another size
// than the camera's. An image without any reading is returned as it is.
DepthImage read_depth(const std::string& path, const Camera& camera);

// Values are rounded to the nearest step of camera.depth_scale; depths beyond 65535 steps become 0.
void write_depth(const DepthImage& depth, const Camera& camera, const std::string& path);

// 8-bit label images. Throws InputError as read_depth does.
LabelImage read_labels(const std::string& path, const Camera& camera);
void write_labels(const LabelImage& labels, const std::string& path);

}  // namespace dofusion
