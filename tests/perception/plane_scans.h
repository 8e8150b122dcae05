// Exact scans of planes, and how readings of them err.
#pragma once

#include <cmath>

#include "perception/sensor_noise.h"

namespace dofusion {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kDegree = kPi / 180.0;

inline const Camera kCamera{600.0, 600.0, 99.5, 99.5, 200, 200, 0.1};
inline constexpr int kPixels = 200 * 200;

// The scan of a plane through the optical axis at `depth`, tilted by `tilt` radians about the image's y axis.
inline Scan plane_scan(double depth, double tilt = 0.0) {
  Scan scan{DepthImage(200, 200), LabelImage(200, 200, kLabelTable), NormalImage(200, 200, Eigen::Vector3f::Zero())};
  const Eigen::Vector3d normal(std::sin(tilt), 0.0, -std::cos(tilt));
  for (int v = 0; v < 200; ++v)
    for (int u = 0; u < 200; ++u) {
      const Eigen::Vector3d ray = unproject(kCamera, u, v, 1.0);
      scan.depth.at(v, u) = static_cast<float>(-std::cos(tilt) * depth / normal.dot(ray));
      scan.normals.at(v, u) = normal.cast<float>();
    }
  return scan;
}

// Two planes that face the camera, the left half of the image at `near`, the right one at `far`.
inline Scan step_scan(double near, double far) {
  Scan scan = plane_scan(far);
  for (int v = 0; v < 200; ++v)
    for (int u = 0; u < 100; ++u) scan.depth.at(v, u) = static_cast<float>(near);
  return scan;
}

struct Errors {
  double mean = 0.0, sigma = 0.0;  // metres, of the readings
  int missing = 0;                 // pixels
};

inline Errors errors(const DepthImage& noisy, const Scan& scan) {
  Errors e;
  double sum = 0.0, squares = 0.0;
  int n = 0;
  for (std::size_t i = 0; i < noisy.pixels.size(); ++i) {
    if (noisy.pixels[i] == 0.0f) {
      ++e.missing;
      continue;
    }
    const double error = static_cast<double>(noisy.pixels[i]) - scan.depth.pixels[i];
    sum += error;
    squares += error * error;
    ++n;
  }
  e.mean = sum / n;
  e.sigma = std::sqrt(squares / n - e.mean * e.mean);
  return e;
}

// Five standard deviations of a count with probability p in n.
inline double count_tolerance(double p, int n) { return 5.0 * std::sqrt(n * p * (1.0 - p)); }

}  // namespace dofusion
