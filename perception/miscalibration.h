// Cameras that are not quite what they are taken for.
#pragma once

#include "perception/camera.h"
#include "stability/pose.h"
#include "stability/random.h"

namespace dofusion {

// Standard deviations of a calibration's errors. None by default: a camera is what it says.
struct Miscalibration {
  double rotation_deg = 0.0;        // of each component of the rotation vector, about the camera's axes
  double translation = 0.0;         // metres, of each coordinate of the camera's position
  double focal_pct = 0.0;           // per cent, of both focal lengths together
  double principal_point_px = 0.0;  // of cx and of cy

  bool any() const {
    return rotation_deg != 0.0 || translation != 0.0 || focal_pct != 0.0 || principal_point_px != 0.0;
  }
};

struct CalibratedCamera {
  Camera camera;
  Pose T_world_camera = Pose::Identity();
};

// What a calibration with such errors, times `scale`, makes of the true camera: the rotation vector (camera's frame),
// the position, one factor for fx and fy, cx and cy get normal errors. The image's size and depth scale stay. Scale 0
// gives back the true camera; a focal length stays above a tenth of the true one. Throws std::invalid_argument if the
// scale or a standard deviation is negative or not finite.
CalibratedCamera miscalibrated(const CalibratedCamera& truth, const Miscalibration& errors, double scale, Rng& rng);

}  // namespace dofusion
