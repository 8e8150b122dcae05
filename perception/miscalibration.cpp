#include "perception/miscalibration.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace dofusion {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

void check(const char* name, double value) {
  if (value >= 0.0 && std::isfinite(value)) return;
  throw std::invalid_argument(std::string("miscalibration: ") + name + " must be 0 or more, not " +
                              std::to_string(value));
}

}  // namespace

CalibratedCamera miscalibrated(const CalibratedCamera& truth, const Miscalibration& errors, double scale, Rng& rng) {
  check("scale", scale);
  check("rotation_deg", errors.rotation_deg);
  check("translation", errors.translation);
  check("focal_pct", errors.focal_pct);
  check("principal_point_px", errors.principal_point_px);
  if (scale == 0.0) return truth;
  CalibratedCamera taken = truth;
  const Eigen::Vector3d turn = normal3(rng, scale * errors.rotation_deg * kDegree);
  const Eigen::Vector3d shift = normal3(rng, scale * errors.translation);
  taken.T_world_camera =
      make_pose(truth.T_world_camera.linear() * so3_exp(turn), truth.T_world_camera.translation() + shift);
  const double focal = std::max(0.1, 1.0 + normal(rng, scale * errors.focal_pct / 100.0));
  taken.camera.fx *= focal;
  taken.camera.fy *= focal;
  taken.camera.cx += normal(rng, scale * errors.principal_point_px);
  taken.camera.cy += normal(rng, scale * errors.principal_point_px);
  return taken;
}

}  // namespace dofusion
