// Planar faces in a depth image.
#pragma once

#include <cstdint>
#include <vector>

#include "perception/table.h"

namespace dofusion {

struct FaceOptions {
  DepthSigma sigma;            // of the depth readings
  double lateral_px = 0.5;     // lateral noise: a steep face's readings scatter by its depth slope times this
  double grow = 3.0;           // sigmas; readings nearer to a growing face's plane join it
  double keep = 4.0;           // sigmas; readings farther from every neighbouring face belong to none
  double normal_deg = 40.0;    // a reading whose surroundings are inclined more to the face does not join it
  double window_sigmas = 6.0;  // radius of the surroundings that a reading's plane is fitted to
  int min_pixels = 30;         // of a face
  int iterations = 6;          // of the competition for readings between neighbouring faces
  double smoothness = 0.4;     // what a neighbour with another face costs, in squared sigmas
};

struct Face {
  InversePlane plane = InversePlane::Zero();  // camera frame, a·X = 1
  int pixels = 0;
  double rms = 0.0;                                               // of its readings, sigmas
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();           // of `plane`, from independent readings
  Eigen::Vector3d normal() const { return -plane.normalized(); }  // towards the camera
};

inline constexpr int kNoFace = -1;

struct FaceMap {
  Image<int> index;  // per pixel a face or kNoFace
  std::vector<Face> faces;
};

// Standard deviation of the inverse depth at z on a face, 1/metre: the sensor's noise and the lateral noise on a slope.
double inverse_sigma(double z, const InversePlane& plane, const Camera& camera, const FaceOptions& options);

// Faces grown from the flattest places over the pixels where `mask` is not zero, then settled between neighbours by
// which plane fits a pixel's surroundings best. Curved surfaces come out as several faces. `fixed` faces (the table)
// come first in the result, are not refitted, and take part in the competition alone. Pixels without a valid reading
// have no face.
FaceMap find_faces(const DepthImage& depth, const Camera& camera, const Image<std::uint8_t>& mask,
                   const std::vector<InversePlane>& fixed, const FaceOptions& options = {});

}  // namespace dofusion
