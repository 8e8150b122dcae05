#include "stability/shape_symmetry.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Dense>

#include "stability/mesh_symmetry.h"
#include "stability/triangle_tree.h"

namespace dofusion {
namespace {

constexpr double kParallel = 1e-2;     // sine of the angle between axes that count as one
constexpr double kSameRotation = 0.2;  // Frobenius norm of the difference of matrices that count as one: 8 degrees
constexpr int kMostTurns = 12;         // of a rotation about the distinct principal axis

// Mean and covariance of the surface's points: they follow from the shape, not from its triangles.
struct SurfaceMoments {
  double area = 0.0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

SurfaceMoments surface_moments(const TriangleMesh& mesh) {
  SurfaceMoments moments;
  const Eigen::Vector3d base = mesh.vertices.empty() ? Eigen::Vector3d::Zero() : mesh.vertices.front();
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]] - base, b = mesh.vertices[t[1]] - base,
                          c = mesh.vertices[t[2]] - base;
    const double area = 0.5 * (b - a).cross(c - a).norm();
    const Eigen::Vector3d sum = a + b + c;
    moments.area += area;
    moments.centre += area / 3.0 * sum;
    // The integral of p p^T over a triangle.
    moments.covariance +=
        area / 12.0 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
  }
  if (!(moments.area > 0.0)) throw std::invalid_argument("a mesh without area has no symmetries to be found");
  moments.centre /= moments.area;
  moments.covariance = moments.covariance / moments.area - moments.centre * moments.centre.transpose();
  moments.centre += base;
  return moments;
}

// A mesh about its centre, and the points by which rotations of it are judged: all corners, or as many as are enough,
// and points spread over the surface.
class Surface {
 public:
  explicit Surface(const TriangleMesh& centred) : tree_(centred) {
    constexpr std::size_t kVertices = 2000;
    constexpr int kSamples = 600;
    const std::size_t step = (centred.vertices.size() + kVertices - 1) / kVertices;
    for (std::size_t i = 0; i < centred.vertices.size(); i += std::max<std::size_t>(1, step)) {
      points_.push_back(centred.vertices[i]);
    }
    Rng rng = make_rng(0, 0);
    for (const SurfaceSample& sample : sample_surface(centred, kSamples, rng)) points_.push_back(sample.point);
    // Those farthest out stray farthest: a rotation that is none fails early.
    std::stable_sort(points_.begin(), points_.end(), [](const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
      return p.squaredNorm() > q.squaredNorm();
    });
  }

  // True if every point, rotated, lies within `distance` of the surface.
  bool keeps(const Eigen::Matrix3d& R, double distance) const {
    return std::all_of(points_.begin(), points_.end(),
                       [&](const Eigen::Vector3d& point) { return tree_.any_within(R * point, distance); });
  }

  const std::vector<Eigen::Vector3d>& points() const { return points_; }

 private:
  TriangleTree tree_;
  std::vector<Eigen::Vector3d> points_;
};

Eigen::Matrix3d turn(double angle, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

bool is_parallel(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return a.cross(b).norm() < kParallel; }

// Rotations that a solid of revolution about `axis` keeps for certain: angles that no small number of sides divides.
bool is_round_about(const Surface& surface, const Eigen::Vector3d& axis, double distance) {
  constexpr int kAngles = 48;
  const double golden = M_PI * (3.0 - std::sqrt(5.0));
  for (int k = 1; k <= kAngles; ++k) {
    if (!surface.keeps(turn(golden * k, axis), distance)) return false;
  }
  return true;
}

struct Axes {
  std::vector<Eigen::Vector3d> all;  // unit, no two parallel; the principal ones first
  int distinct = -1;                 // the principal one whose moment differs from two equal ones; -1: none does
};

// Where an axis of symmetry can lie: a principal axis, or, where moments are equal, the normal of a flat face.
Axes candidate_axes(const TriangleMesh& centred, const Eigen::Matrix3d& covariance) {
  Axes axes;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(covariance);
  const Eigen::Vector3d moments = principal.eigenvalues();
  const auto add = [&](Eigen::Vector3d axis) {
    // Along a coordinate axis it is exactly that.
    for (int k = 0; k < 3; ++k) {
      if (is_parallel(axis, Eigen::Vector3d::Unit(k)) && std::abs(axis[k]) > 1.0 - 1e-9)
        axis = Eigen::Vector3d::Unit(k);
    }
    const bool known = std::any_of(axes.all.begin(), axes.all.end(),
                                   [&](const Eigen::Vector3d& other) { return is_parallel(axis, other); });
    if (!known) axes.all.push_back(axis);
  };
  for (int k = 0; k < 3; ++k) add(principal.eigenvectors().col(k));
  const double equal = 0.02 * moments[2];
  const bool low = moments[1] - moments[0] < equal, high = moments[2] - moments[1] < equal;
  if (low != high) axes.distinct = low ? 2 : 0;
  for (int k = 0; k < 3; ++k) add(Eigen::Vector3d::Unit(k));
  constexpr std::size_t kFewTriangles = 5000;  // planar_faces compares each with each
  if (centred.triangles.size() <= kFewTriangles) {
    for (const PlanarFace& face : planar_faces(centred)) add(face.normal);
  }
  return axes;
}

std::vector<Eigen::Matrix3d> discrete_candidates(const TriangleMesh& centred, const Axes& axes, double tolerance) {
  std::vector<Eigen::Matrix3d> candidates = rotation_symmetries(centred, tolerance);
  candidates.erase(candidates.begin());  // the identity
  for (std::size_t k = 0; k < 3 && k < axes.all.size(); ++k) candidates.push_back(turn(M_PI, axes.all[k]));
  if (axes.distinct >= 0) {
    const Eigen::Vector3d& axis = axes.all[static_cast<std::size_t>(axes.distinct)];
    for (int n = 3; n <= kMostTurns; ++n) {
      for (int k = 1; k < n; ++k) candidates.push_back(turn(2.0 * M_PI * k / n, axis));
    }
  }
  return candidates;
}

// Entries that differ from -1, 0 or 1 by rounding alone are these.
Eigen::Matrix3d tidy(const Eigen::Matrix3d& R) {
  return R.unaryExpr([](double x) { return std::abs(x - std::round(x)) < 1e-9 ? std::round(x) + 0.0 : x; });
}

bool is_ball(const Surface& surface, double distance) {
  const auto& points = surface.points();  // by falling radius
  return points.front().norm() - points.back().norm() <= distance;
}

// Those of the candidates that keep the surface. Of candidates a few degrees apart, which a shape of many sides keeps
// within the tolerance, the exact one counts.
std::vector<Eigen::Matrix3d> distinct_symmetries(const Surface& surface, const std::vector<Eigen::Matrix3d>& candidates,
                                                 double distance) {
  std::vector<Eigen::Matrix3d> found;
  const auto is_known = [&](const Eigen::Matrix3d& R) {
    if ((R - Eigen::Matrix3d::Identity()).norm() < kSameRotation) return true;
    return std::any_of(found.begin(), found.end(),
                       [&](const Eigen::Matrix3d& other) { return (other - R).norm() < kSameRotation; });
  };
  for (const double strictness : {0.01, 0.1, 0.3, 1.0}) {
    for (const Eigen::Matrix3d& R : candidates) {
      if (!is_known(R) && surface.keeps(R, strictness * distance)) found.push_back(tidy(R));
    }
  }
  return found;
}

// The symmetries about the origin.
ShapeSymmetry symmetry_about_origin(const TriangleMesh& centred, const SurfaceMoments& moments, double tolerance) {
  ShapeSymmetry symmetry;
  const double distance = tolerance * diameter(centred);
  const Surface surface(centred);
  symmetry.ball = is_ball(surface, distance);
  if (symmetry.ball) return symmetry;
  const Axes axes = candidate_axes(centred, moments.covariance);
  for (const Eigen::Vector3d& axis : axes.all) {
    if (!is_round_about(surface, axis, distance)) continue;
    symmetry.axis = axis;
    const Eigen::Matrix3d swap_ends = turn(M_PI, axis.unitOrthogonal());
    if (surface.keeps(swap_ends, distance)) symmetry.rotations.push_back(tidy(swap_ends));
    return symmetry;
  }
  symmetry.rotations = distinct_symmetries(surface, discrete_candidates(centred, axes, tolerance), distance);
  return symmetry;
}

}  // namespace

ShapeSymmetry symmetry_of(const TriangleMesh& mesh, double tolerance) {
  const SurfaceMoments moments = surface_moments(mesh);
  ShapeSymmetry symmetry = symmetry_about_origin(weld(translated(mesh, -moments.centre)), moments, tolerance);
  // Rounding must not show in a file as an offset of 1e-18.
  const BoundingBox box = bounding_box(mesh);
  const double rounding = 1e-9 * (box.max - box.min).norm();
  symmetry.centre = moments.centre.unaryExpr([&](double x) { return std::abs(x) < rounding ? 0.0 : x; });
  return symmetry;
}

ShapeSymmetry symmetry_of(const Object& object, double tolerance) {
  ShapeSymmetry symmetry;
  if (object.kind == SolidKind::kSphere) {
    symmetry.ball = true;
  } else if (object.kind == SolidKind::kCylinder) {
    symmetry.axis = Eigen::Vector3d::UnitZ();
    symmetry.rotations = {Eigen::Vector3d(1, -1, -1).asDiagonal()};
  } else {
    symmetry = symmetry_about_origin(weld(object.mesh), surface_moments(object.mesh), tolerance);
  }
  return symmetry;
}

}  // namespace dofusion
