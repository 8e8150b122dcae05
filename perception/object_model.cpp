#include "perception/object_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dofusion {
namespace {

constexpr std::size_t kMostProbes = 400;

// Corners, points along the edges and face centres. Large meshes give an even choice of their vertices.
std::vector<Eigen::Vector3d> make_probes(const Object& object) {
  const TriangleMesh& mesh = object.mesh;
  std::vector<Eigen::Vector3d> probes = mesh.vertices;
  const double spacing = object.diameter / 8.0;
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      const int from = triangle[k], to = triangle[(k + 1) % 3];
      if (from > to) continue;  // the neighbour's edge runs the other way
      const Eigen::Vector3d &a = mesh.vertices[from], &b = mesh.vertices[to];
      const int pieces = static_cast<int>(std::ceil((b - a).norm() / spacing));
      for (int i = 1; i < pieces; ++i) probes.push_back(a + (b - a) * i / pieces);
    }
    probes.push_back((mesh.vertices[triangle[0]] + mesh.vertices[triangle[1]] + mesh.vertices[triangle[2]]) / 3.0);
  }
  if (probes.size() <= kMostProbes) return probes;
  std::vector<Eigen::Vector3d> chosen;
  for (std::size_t i = 0; i < kMostProbes; ++i) chosen.push_back(probes[i * probes.size() / kMostProbes]);
  return chosen;
}

// The faces an object can rest on, one of each class that its symmetries map to each other.
std::vector<DistinctRest> distinct_rests(const TriangleMesh& mesh, const std::vector<Eigen::Matrix3d>& symmetries) {
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();
  std::vector<DistinctRest> rests;
  for (const RestingPose& pose : resting_poses(mesh)) {
    const Eigen::Vector3d face = pose.R_world_object.transpose() * down;
    const bool seen = std::any_of(rests.begin(), rests.end(), [&](const DistinctRest& other) {
      return std::any_of(symmetries.begin(), symmetries.end(), [&](const Eigen::Matrix3d& R) {
        return (other.pose.R_world_object * R * face - down).norm() < 1e-2;
      });
    });
    if (!seen) rests.push_back({pose, 2.0 * M_PI / symmetry_order(symmetries, face)});
  }
  return rests;
}

// The smallest distance of a's probes to b.
double probe_distance(const ObjectModel& a, const ObjectModel& b, const Pose& T_b_a) {
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& probe : a.probes) {
    const Eigen::Vector3d p_b = T_b_a * probe;
    if (p_b.norm() - b.radius > least) continue;  // cannot be nearer
    least = std::min(least, b.distance(p_b));
  }
  return least;
}

// The deepest a's probes lie in b.
double probe_depth(const ObjectModel& a, const ObjectModel& b, const Pose& T_b_a) {
  if (b.half_spaces.empty()) return std::max(0.0, -probe_distance(a, b, T_b_a));
  double deepest = 0.0;
  for (const Eigen::Vector3d& probe : a.probes) {
    const Eigen::Vector3d p_b = T_b_a * probe;
    double depth = std::numeric_limits<double>::infinity();
    for (const auto& [normal, offset] : b.half_spaces) {
      depth = std::min(depth, offset - normal.dot(p_b));
      if (depth <= deepest) break;
    }
    deepest = std::max(deepest, depth);
  }
  return deepest;
}

std::vector<std::pair<Eigen::Vector3d, double>> half_spaces_of(const Object& object) {
  constexpr int kMostHalfSpaces = 64;
  std::vector<std::pair<Eigen::Vector3d, double>> half_spaces;
  const TriangleMesh& mesh = object.mesh;
  if (!object.convex) return half_spaces;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
    const bool known = std::any_of(half_spaces.begin(), half_spaces.end(),
                                   [&](const auto& other) { return (other.first - normal).norm() < 1e-4; });
    if (!known) half_spaces.emplace_back(normal, normal.dot(a));
  }
  if (half_spaces.size() > kMostHalfSpaces) half_spaces.clear();
  return half_spaces;
}

double outer_radius(const Object& object) {
  double largest = 0.0;
  for (const Eigen::Vector3d& vertex : object.mesh.vertices) largest = std::max(largest, vertex.norm());
  return largest;
}

}  // namespace

ObjectModel::ObjectModel(const ObjectPtr& object_)
    : object(object_),
      symmetries(rotation_symmetries(object_->mesh)),
      faces(planar_faces(object_->mesh)),
      distinct(distinct_faces(faces, symmetries)),
      resting(distinct_rests(object_->mesh, symmetries)),
      half_spaces(half_spaces_of(*object_)),
      probes(make_probes(*object_)),
      distance(object_->mesh),
      radius(outer_radius(*object_)) {}

double clearance(const ObjectModel& a, const Pose& T_world_a, const ObjectModel& b, const Pose& T_world_b) {
  const double apart = (T_world_a.translation() - T_world_b.translation()).norm() - a.radius - b.radius;
  if (apart > 0.5 * (a.radius + b.radius)) return apart;
  const Pose T_b_a = T_world_b.inverse() * T_world_a;
  return std::min(probe_distance(a, b, T_b_a), probe_distance(b, a, T_b_a.inverse()));
}

double overlap(const ObjectModel& a, const Pose& T_world_a, const ObjectModel& b, const Pose& T_world_b) {
  const double apart = (T_world_a.translation() - T_world_b.translation()).norm() - a.radius - b.radius;
  if (apart > 0.0) return 0.0;
  const Pose T_b_a = T_world_b.inverse() * T_world_a;
  return std::max(probe_depth(a, b, T_b_a), probe_depth(b, a, T_b_a.inverse()));
}

double lowest_point(const ObjectModel& model, const Pose& T_world_object) {
  const Eigen::Vector3d down = T_world_object.linear().row(2);
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& vertex : model.object->mesh.vertices) least = std::min(least, down.dot(vertex));
  return least + T_world_object.translation().z();
}

}  // namespace dofusion
