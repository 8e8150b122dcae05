#include "stability/signed_triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include <Eigen/Geometry>

namespace dofusion {
namespace {

enum class Feature { kFace, kVertexA, kVertexB, kVertexC, kEdgeAB, kEdgeBC, kEdgeCA };

struct Closest {
  Eigen::Vector3d point;
  Feature feature;
};

// Closest point of triangle abc to p and the feature it lies on (after Ericson, Real-Time Collision Detection, 5.1.5).
Closest closest_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d1 <= 0 && d2 <= 0) return {a, Feature::kVertexA};
  if (d3 >= 0 && d4 <= d3) return {b, Feature::kVertexB};
  if (d6 >= 0 && d5 <= d6) return {c, Feature::kVertexC};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {a + d1 / (d1 - d3) * ab, Feature::kEdgeAB};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {a + d2 / (d2 - d6) * ac, Feature::kEdgeCA};
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return {b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b), Feature::kEdgeBC};
  }
  const double scale = 1.0 / (va + vb + vc);
  return {a + vb * scale * ab + vc * scale * ac, Feature::kFace};
}

double angle_at(const Eigen::Vector3d& corner, const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
  const Eigen::Vector3d u = p - corner, v = q - corner;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

}  // namespace

std::vector<SignedTriangle> signed_triangles(const TriangleMesh& input) {
  const TriangleMesh mesh = weld(input);
  if (mesh.triangles.empty()) throw std::invalid_argument("signed distance to a mesh without triangles");
  std::vector<SignedTriangle> triangles;
  triangles.reserve(mesh.triangles.size());
  std::vector<Eigen::Vector3d> vertex_normals(mesh.vertices.size(), Eigen::Vector3d::Zero());
  std::map<std::pair<int, int>, Eigen::Vector3d> edge_normals;
  const auto edge_key = [](int i, int j) { return std::make_pair(std::min(i, j), std::max(i, j)); };

  for (const Eigen::Vector3i& t : mesh.triangles) {
    SignedTriangle triangle;
    triangle.a = mesh.vertices[t[0]];
    triangle.b = mesh.vertices[t[1]];
    triangle.c = mesh.vertices[t[2]];
    triangle.normal = (triangle.b - triangle.a).cross(triangle.c - triangle.a).normalized();
    const std::array<Eigen::Vector3d, 3> corners = {triangle.a, triangle.b, triangle.c};
    for (int k = 0; k < 3; ++k) {
      vertex_normals[t[k]] += angle_at(corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]) * triangle.normal;
      edge_normals.emplace(edge_key(t[k], t[(k + 1) % 3]), Eigen::Vector3d::Zero()).first->second += triangle.normal;
    }
    triangles.push_back(triangle);
  }
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Eigen::Vector3i& t = mesh.triangles[i];
    for (int k = 0; k < 3; ++k) {
      triangles[i].vertex_normals[k] = vertex_normals[t[k]];
      triangles[i].edge_normals[k] = edge_normals.at(edge_key(t[k], t[(k + 1) % 3]));
    }
  }
  return triangles;
}

TriangleDistance distance_to_triangle(const SignedTriangle& t, const Eigen::Vector3d& p) {
  const Closest closest = closest_on_triangle(p, t.a, t.b, t.c);
  const Eigen::Vector3d offset = p - closest.point;
  const auto towards = [&](const Eigen::Vector3d& normal) {
    return TriangleDistance{offset.squaredNorm(), offset.dot(normal)};
  };
  switch (closest.feature) {
    case Feature::kVertexA:
      return towards(t.vertex_normals[0]);
    case Feature::kVertexB:
      return towards(t.vertex_normals[1]);
    case Feature::kVertexC:
      return towards(t.vertex_normals[2]);
    case Feature::kEdgeAB:
      return towards(t.edge_normals[0]);
    case Feature::kEdgeBC:
      return towards(t.edge_normals[1]);
    case Feature::kEdgeCA:
      return towards(t.edge_normals[2]);
    case Feature::kFace:
      break;
  }
  return towards(t.normal);
}

}  // namespace dofusion
