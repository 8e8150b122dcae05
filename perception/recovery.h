// A scene from a depth image: the table, the objects on it, their shapes and poses.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "perception/camera.h"
#include "perception/image.h"
#include "stability/scene.h"

namespace dofusion {

// The table's plane, seen from the camera. The world has z up and the table at z = 0; its origin is where the
// optical axis meets the table (or, if it does not, the foot of the camera), and its x axis is the camera's x
// projected onto the table.
struct Table {
  Pose T_world_camera = Pose::Identity();
  int inliers = 0;           // pixels on the plane
  double residual = 0.0;     // metres, root mean square of the inliers
};

struct RecoveredObject {
  ObjectPtr object;
  Pose T_world_object = Pose::Identity();
  std::string name;          // the library's name if known, else "object_<index>"
  bool known = false;
  int label = 0;             // in the label image
  int pixels = 0;            // with that label
  double score = 0.0;        // known objects: share of the object's pixels that the mesh explains
};

}  // namespace dofusion
