// Rigid poses. T_a_b maps coordinates in b to coordinates in a; metres and radians.
#pragma once

#include <array>

#include <Eigen/Geometry>

namespace dofusion {

using Pose = Eigen::Isometry3d;

// Exponential map of SO(3): the rotation by |w| radians about w (identity at w = 0).
Eigen::Matrix3d so3_exp(const Eigen::Vector3d& w);

// Logarithm of SO(3): the rotation vector of R, with length in [0, pi]. At pi either of the two axes.
Eigen::Vector3d so3_log(const Eigen::Matrix3d& R);

// Angle of the rotation R in [0, pi] radians, exact near 0 as well.
double rotation_angle(const Eigen::Matrix3d& R);

Pose make_pose(const Eigen::Matrix3d& R, const Eigen::Vector3d& t);

// Position and quaternion in MuJoCo's order: x y z, then w x y z. The quaternion need not be normalised on the way
// in; w >= 0 on the way out. The only place where the two orders of quaternions meet.
using PoseArray = std::array<double, 7>;
PoseArray to_array(const Pose& pose);
Pose from_array(const PoseArray& xyz_wxyz);

}  // namespace dofusion
