#include "stability/mesh_symmetry.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace dofusion {
namespace {

constexpr std::size_t kMostCorners = 400;
constexpr double kSameDirection = 1e-3;  // 1 - cosine would be 5e-7; compared as the length of a difference

bool maps_to_itself(const std::vector<Eigen::Vector3d>& corners, const Eigen::Matrix3d& R, double tolerance) {
  for (const Eigen::Vector3d& corner : corners) {
    const Eigen::Vector3d image = R * corner;
    const bool found = std::any_of(corners.begin(), corners.end(), [&](const Eigen::Vector3d& other) {
      return (other - image).squaredNorm() < tolerance * tolerance;
    });
    if (!found) return false;
  }
  return true;
}

// The right-handed frame of two directions.
Eigen::Matrix3d frame_of(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Eigen::Matrix3d frame;
  frame.col(0) = a.normalized();
  frame.col(2) = a.cross(b).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

// The vertices at which the surface bends in more than one direction: those in the middle of a face or of an edge say
// how it was cut into triangles, not what its shape is.
std::vector<Eigen::Vector3d> corners_of(const TriangleMesh& mesh) {
  const TriangleMesh welded = weld(mesh);
  std::vector<Eigen::Matrix3d> spread(welded.vertices.size(), Eigen::Matrix3d::Zero());  // of the normals at a vertex
  for (const Eigen::Vector3i& triangle : welded.triangles) {
    const Eigen::Vector3d& a = welded.vertices[triangle[0]];
    const Eigen::Vector3d normal =
        (welded.vertices[triangle[1]] - a).cross(welded.vertices[triangle[2]] - a).stableNormalized();
    for (int k = 0; k < 3; ++k) spread[triangle[k]] += normal * normal.transpose();
  }
  constexpr double kFlat = 1e-8;  // square of the sine of 1e-4 rad
  std::vector<Eigen::Vector3d> corners;
  for (std::size_t i = 0; i < spread.size(); ++i) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread[i], Eigen::EigenvaluesOnly);
    if (axes.eigenvalues()[0] > kFlat) corners.push_back(welded.vertices[i]);
  }
  return corners;
}

// The corner that makes the best frame with the first one.
std::size_t partner_of_first(const std::vector<Eigen::Vector3d>& corners) {
  std::size_t best = 0;
  double largest = 0.0;
  for (std::size_t i = 1; i < corners.size(); ++i) {
    const double area = corners[0].cross(corners[i]).norm();
    if (area > largest) {
      largest = area;
      best = i;
    }
  }
  return best;
}

}  // namespace

std::vector<Eigen::Matrix3d> rotation_symmetries(const TriangleMesh& mesh, double tolerance) {
  std::vector<Eigen::Matrix3d> symmetries = {Eigen::Matrix3d::Identity()};
  const std::vector<Eigen::Vector3d> corners = corners_of(mesh);
  if (corners.size() < 3 || corners.size() > kMostCorners) return symmetries;
  const std::size_t partner = partner_of_first(corners);
  const Eigen::Vector3d a = corners[0], b = corners[partner];
  const double within = tolerance * diameter(mesh);
  const Eigen::Matrix3d from = frame_of(a, b);
  const auto same_length = [&](const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
    return std::abs(p.norm() - q.norm()) < within;
  };
  for (const Eigen::Vector3d& to_a : corners) {
    if (!same_length(a, to_a)) continue;
    for (const Eigen::Vector3d& to_b : corners) {
      if (!same_length(b, to_b) || !same_length(b - a, to_b - to_a) || to_a.cross(to_b).norm() < within * within) {
        continue;
      }
      const Eigen::Matrix3d R = frame_of(to_a, to_b) * from.transpose();
      const bool is_new = std::none_of(symmetries.begin(), symmetries.end(),
                                       [&](const Eigen::Matrix3d& other) { return (other - R).norm() < 1e-2; });
      if (is_new && maps_to_itself(corners, R, within)) symmetries.push_back(R);
    }
  }
  return symmetries;
}

std::vector<PlanarFace> planar_faces(const TriangleMesh& mesh, int limit) {
  const double size = diameter(mesh);
  std::vector<PlanarFace> faces;
  double total_area = 0.0;
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    const Eigen::Vector3d &a = mesh.vertices[triangle[0]], &b = mesh.vertices[triangle[1]],
                          &c = mesh.vertices[triangle[2]];
    const Eigen::Vector3d cross = (b - a).cross(c - a);
    const double area = 0.5 * cross.norm();
    if (area <= 0.0) continue;
    total_area += area;
    const Eigen::Vector3d normal = cross.normalized();
    auto face = std::find_if(faces.begin(), faces.end(), [&](const PlanarFace& other) {
      return (other.normal - normal).norm() < kSameDirection &&
             std::abs(other.normal.dot(a - other.corners.front())) < 1e-4 * size;
    });
    if (face == faces.end()) {
      faces.push_back({normal, Eigen::Vector3d::Zero(), {}, 0.0});
      face = faces.end() - 1;
    }
    face->centroid += area * (a + b + c) / 3.0;
    face->area += area;
    for (const Eigen::Vector3d& corner : {a, b, c}) {
      const bool known = std::any_of(face->corners.begin(), face->corners.end(),
                                     [&](const Eigen::Vector3d& p) { return (p - corner).norm() < 1e-6 * size; });
      if (!known) face->corners.push_back(corner);
    }
  }
  for (PlanarFace& face : faces) face.centroid /= face.area;
  std::stable_sort(faces.begin(), faces.end(),
                   [](const PlanarFace& p, const PlanarFace& q) { return p.area > q.area; });
  const auto too_small = [&](const PlanarFace& face) { return face.area < 0.01 * total_area; };
  faces.erase(std::find_if(faces.begin(), faces.end(), too_small), faces.end());
  if (static_cast<int>(faces.size()) > limit) faces.resize(limit);
  return faces;
}

int symmetry_order(const std::vector<Eigen::Matrix3d>& symmetries, const Eigen::Vector3d& direction) {
  return static_cast<int>(std::count_if(symmetries.begin(), symmetries.end(), [&](const Eigen::Matrix3d& R) {
    return (R * direction - direction).norm() < 10.0 * kSameDirection;
  }));
}

std::vector<PlanarFace> distinct_faces(const std::vector<PlanarFace>& faces,
                                       const std::vector<Eigen::Matrix3d>& symmetries) {
  std::vector<PlanarFace> distinct;
  for (const PlanarFace& face : faces) {
    const bool seen = std::any_of(distinct.begin(), distinct.end(), [&](const PlanarFace& other) {
      const double size = 10.0 * kSameDirection * (face.centroid.norm() + other.centroid.norm());
      return std::any_of(symmetries.begin(), symmetries.end(), [&](const Eigen::Matrix3d& R) {
        return (R * face.normal - other.normal).norm() < 10.0 * kSameDirection &&
               (R * face.centroid - other.centroid).norm() < size;
      });
    });
    if (!seen) distinct.push_back(face);
  }
  return distinct;
}

}  // namespace dofusion
