#include "stability/resting_poses.h"

#include <algorithm>
#include <limits>

#include <Eigen/Geometry>

#include "stability/convex_hull.h"

namespace dofusion {
namespace {

// Distance from the foot of the origin to the border of the hull's face with `normal`; negative if it lies outside.
double foot_margin(const TriangleMesh& hull, const Eigen::Vector3d& normal, double offset, double tolerance) {
  // An edge of the face is a triangle edge whose other triangle lies in another plane.
  const auto in_face = [&](const Eigen::Vector3i& t) {
    return std::all_of(t.data(), t.data() + 3,
                       [&](int v) { return normal.dot(hull.vertices[v]) > offset - tolerance; });
  };
  std::vector<std::pair<int, int>> directed;
  for (const Eigen::Vector3i& t : hull.triangles) {
    if (!in_face(t)) continue;
    for (int k = 0; k < 3; ++k) directed.emplace_back(t[k], t[(k + 1) % 3]);
  }
  const Eigen::Vector3d foot = offset * normal;
  double margin = std::numeric_limits<double>::infinity();
  for (const auto& [from, to] : directed) {
    if (std::find(directed.begin(), directed.end(), std::make_pair(to, from)) != directed.end()) continue;
    const Eigen::Vector3d edge = hull.vertices[to] - hull.vertices[from];
    const Eigen::Vector3d inward = normal.cross(edge).normalized();
    margin = std::min(margin, inward.dot(foot - hull.vertices[from]));
  }
  return margin;
}

}  // namespace

std::vector<RestingPose> resting_poses(const TriangleMesh& mesh, double min_margin) {
  const TriangleMesh hull = convex_hull(mesh.vertices);
  const BoundingBox box = bounding_box(hull);
  const double extent = (box.max - box.min).norm();
  const double tolerance = 1e-6 * extent;

  std::vector<Eigen::Vector3d> normals;
  std::vector<RestingPose> poses;
  for (const Eigen::Vector3i& t : hull.triangles) {
    const Eigen::Vector3d& a = hull.vertices[t[0]];
    const Eigen::Vector3d normal = (hull.vertices[t[1]] - a).cross(hull.vertices[t[2]] - a).normalized();
    if (!normal.allFinite()) continue;
    const auto same = [&](const Eigen::Vector3d& other) { return normal.dot(other) > 1.0 - 1e-9; };
    if (std::any_of(normals.begin(), normals.end(), same)) continue;  // another triangle of that face
    normals.push_back(normal);
    const double margin = foot_margin(hull, normal, normal.dot(a), tolerance);
    if (!(margin > min_margin * extent)) continue;
    const Eigen::Matrix3d R =
        Eigen::Quaterniond::FromTwoVectors(normal, -Eigen::Vector3d::UnitZ()).toRotationMatrix();
    poses.push_back({R, normal.dot(a), margin});
  }
  return poses;
}

}  // namespace dofusion
