#include "perception/pose_refinement.h"

#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

namespace dofusion {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct NormalEquations {
  Matrix6d H = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();
};

// Unit normals of the triangles, in the camera's frame.
std::vector<Eigen::Vector3d> triangle_normals(const TriangleMesh& mesh, const Eigen::Matrix3d& R_camera_object) {
  std::vector<Eigen::Vector3d> normals;
  normals.reserve(mesh.triangles.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    normals.push_back((R_camera_object * (b - a).cross(c - a)).normalized());
  }
  return normals;
}

// Sums over the pixels that see the object within the gate. Moving a surface point by d moves the depth along its
// pixel's ray by n·d / n·ray.
void add_depth_equations(ViewScorer& scorer, const ViewExplanation& scene, const TriangleMesh& mesh,
                         const Pose& T_world_object, double gate, NormalEquations& sums) {
  const RasterPatch& patch = scorer.render(mesh, T_world_object);
  const Observation& seen = scorer.observation();
  const Pose T_camera_object = seen.T_camera_world * T_world_object;
  const Eigen::Matrix3d R_world_camera = seen.T_camera_world.linear().transpose();
  const std::vector<Eigen::Vector3d> normals = triangle_normals(mesh, T_camera_object.linear());
  for (int row = 0; row < patch.height; ++row) {
    for (int column = 0; column < patch.width; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * patch.width + column;
      if (patch.inverse_depth[i] <= 0.0f) continue;
      const int v = patch.v0 + row, u = patch.u0 + column;
      const double z = 1.0 / patch.inverse_depth[i], reading = seen.depth.at(v, u);
      if (reading <= 0.0 || std::abs(reading - z) > gate || z > scene.depth.at(v, u) + gate) continue;
      const Eigen::Vector3d& normal = normals[patch.face[i]];
      const Eigen::Vector3d ray = pixel_ray(seen.camera, u, v);
      const double facing = normal.dot(ray);
      if (std::abs(facing) < 0.1) continue;  // grazing: a hair's breadth sideways is a long way in depth
      const Eigen::Vector3d slope = R_world_camera * normal / facing;
      const Eigen::Vector3d arm = R_world_camera * (ray * z - T_camera_object.translation());
      Vector6d J;
      J << slope, arm.cross(slope);
      const double weight = 1.0 / (seen.variance.at(v, u) + kExactness * kExactness / (facing * facing));
      sums.H.selfadjointView<Eigen::Lower>().rankUpdate(J, weight);
      sums.g += weight * (reading - z) * J;
    }
  }
}

NormalEquations depth_equations(PoseScorer& scorer, const Explanation& scene, const TriangleMesh& mesh,
                                const Pose& T_world_object, double gate) {
  NormalEquations sums;
  for (std::size_t i = 0; i < scene.size(); ++i) {
    add_depth_equations(scorer.views()[i], scene[i], mesh, T_world_object, gate, sums);
  }
  sums.H = Matrix6d(sums.H.selfadjointView<Eigen::Lower>());
  return sums;
}

// The directions a pose may move along, as columns.
Eigen::Matrix<double, 6, Eigen::Dynamic> directions(Freedom freedom) {
  if (freedom == Freedom::kFree) return Matrix6d::Identity();
  Eigen::Matrix<double, 6, Eigen::Dynamic> B = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, 3);
  B(0, 0) = B(1, 1) = B(5, 2) = 1.0;
  return B;
}

// Directions that no face fixes stay where they are: a prior of 1 cm and 0.2 rad about the present pose.
Vector6d damping() {
  Vector6d d;
  d << Eigen::Vector3d::Constant(1.0 / (0.01 * 0.01)), Eigen::Vector3d::Constant(1.0 / (0.2 * 0.2));
  return d;
}

}  // namespace

Pose moved(const Pose& T_world_object, const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation) {
  return make_pose(so3_exp(rotation) * T_world_object.linear(), T_world_object.translation() + translation);
}

Pose align_to_readings(PoseScorer& scorer, const Explanation& scene, const TriangleMesh& mesh, const Pose& start,
                       Freedom freedom, const AlignOptions& options) {
  const auto B = directions(freedom);
  const Eigen::MatrixXd prior = B.transpose() * damping().asDiagonal() * B;
  Pose pose = start;
  for (int i = 0; i < options.iterations; ++i) {
    const double progress = options.iterations > 1 ? static_cast<double>(i) / (options.iterations - 1) : 1.0;
    const double gate = options.first_gate * std::pow(options.last_gate / options.first_gate, progress);
    const NormalEquations sums = depth_equations(scorer, scene, mesh, pose, gate);
    const Eigen::MatrixXd H = B.transpose() * sums.H * B + prior;
    const Vector6d step = B * H.ldlt().solve(B.transpose() * sums.g);
    pose = moved(pose, step.head<3>(), step.tail<3>());
  }
  return pose;
}

ScoredPose climb(const PoseObjective& objective, const ScoredPose& start, Freedom freedom, double radius,
                 const ClimbOptions& options) {
  const auto B = directions(freedom);
  const int count = static_cast<int>(B.cols());
  ScoredPose best = start;
  for (double step = options.first_step; step > 0.99 * options.last_step; step *= 0.5) {
    // At the best pose so far `failed` directions in a row have led nowhere, and `came_from` leads back.
    int failed = 0;
    std::pair<int, double> came_from(-1, 0.0);
    for (int round = 0; round < options.rounds_per_step && failed < count; ++round) {
      for (int k = 0; k < count && failed < count; ++k) {
        ++failed;
        for (const double sign : {1.0, -1.0}) {
          if (came_from == std::pair(k, sign)) continue;
          const Vector6d direction = sign * step * B.col(k);
          const Pose pose = moved(best.T_world_object, direction.head<3>(), direction.tail<3>() / radius);
          const double score = objective(pose);
          if (score <= best.score) continue;
          best = {pose, score};
          came_from = {k, -sign};
          failed = 0;
          break;
        }
      }
    }
  }
  return best;
}

}  // namespace dofusion
