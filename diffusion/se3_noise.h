// Noise on poses and the targets that undo it. Twists: translation first, rotation second, as in the paper.
#pragma once

#include <Eigen/Core>

#include "stability/pose.h"
#include "stability/random.h"

namespace dofusion {

using Vector6 = Eigen::Matrix<double, 6, 1>;

// A draw of N(0, sigma^2 I).
Vector6 noise6(Rng& rng, double sigma);

// The paper's equation (3): position t + e[0:3], rotation R exp(e[3:6]), in the body frame. Lengths of e are in units
// of `length` metres.
Pose add_body_noise(const Pose& pose, const Vector6& e, double length = 1.0);

// Inverse of the above: the pose that e was added to.
Pose remove_body_noise(const Pose& noisy, const Vector6& e, double length = 1.0);

// World-frame noise: position t + e[0:3], rotation exp(e[3:6]) R.
Pose add_world_noise(const Pose& pose, const Vector6& e, double length = 1.0);

// Scale of the rotation part of a residual: about sigma while that is small, at most 1.5 radians, because an angle
// saturates at pi however large the noise.
double rotation_scale(double sigma);

// The residual that leads from `noisy` to `clean` in the world frame about the object's position: translation over
// sigma, rotation vector of R_clean R_noisy^T over rotation_scale(sigma). What the `default` network predicts.
Vector6 world_residual(const Pose& noisy, const Pose& clean, double sigma, double length = 1.0);

// Inverse of world_residual: the clean pose.
Pose apply_world_residual(const Pose& noisy, const Vector6& residual, double sigma, double length = 1.0);

}  // namespace dofusion
