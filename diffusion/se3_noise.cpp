#include "diffusion/se3_noise.h"

#include <cmath>

namespace dofusion {

Vector6 noise6(Rng& rng, double sigma) {
  Vector6 e;
  e << normal3(rng, sigma), normal3(rng, sigma);
  return e;
}

Pose add_body_noise(const Pose& pose, const Vector6& e, double length) {
  return make_pose(pose.linear() * so3_exp(e.tail<3>()), pose.translation() + length * e.head<3>());
}

Pose remove_body_noise(const Pose& noisy, const Vector6& e, double length) {
  return make_pose(noisy.linear() * so3_exp(-e.tail<3>()), noisy.translation() - length * e.head<3>());
}

Pose add_world_noise(const Pose& pose, const Vector6& e, double length) {
  return make_pose(so3_exp(e.tail<3>()) * pose.linear(), pose.translation() + length * e.head<3>());
}

double rotation_scale(double sigma) { return sigma / std::sqrt(1.0 + (sigma / 1.5) * (sigma / 1.5)); }

Vector6 world_residual(const Pose& noisy, const Pose& clean, double sigma, double length) {
  Vector6 residual;
  residual.head<3>() = (clean.translation() - noisy.translation()) / (length * sigma);
  residual.tail<3>() = so3_log(clean.linear() * noisy.linear().transpose()) / rotation_scale(sigma);
  return residual;
}

Pose apply_world_residual(const Pose& noisy, const Vector6& residual, double sigma, double length) {
  return make_pose(so3_exp(residual.tail<3>() * rotation_scale(sigma)) * noisy.linear(),
                   noisy.translation() + length * sigma * residual.head<3>());
}

}  // namespace dofusion
