#include "stability/mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <unordered_set>

#include <Eigen/Geometry>

#include "stability/mesh_topology.h"
#include "stability/point_tree.h"

namespace dofusion {
namespace {

Eigen::Vector3d area_vector(const TriangleMesh& mesh, const Eigen::Vector3i& t) {
  const Eigen::Vector3d& a = mesh.vertices[t[0]];
  return 0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
}

struct PlaneHash {
  std::size_t operator()(const std::array<long, 4>& key) const {
    std::size_t hash = 0;
    for (const long k : key) hash = (hash ^ static_cast<std::size_t>(k)) * 0x9e3779b97f4a7c15ULL;
    return hash ^ (hash >> 32);
  }
};

}  // namespace

double volume(const TriangleMesh& mesh) {
  double six_volumes = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    six_volumes += mesh.vertices[t[0]].dot(mesh.vertices[t[1]].cross(mesh.vertices[t[2]]));
  }
  return six_volumes / 6.0;
}

Eigen::Vector3d centre_of_mass(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) throw std::invalid_argument("centre of mass of an empty mesh");
  // Signed tetrahedra over the first vertex rather than the origin: exact for meshes far from it as well.
  const Eigen::Vector3d reference = mesh.vertices.front();
  double total = 0.0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]] - reference, b = mesh.vertices[t[1]] - reference,
                          c = mesh.vertices[t[2]] - reference;
    const double six_volumes = a.dot(b.cross(c));
    total += six_volumes;
    moment += six_volumes * (a + b + c) / 4.0;
  }
  if (!(std::abs(total) > 0.0)) throw std::invalid_argument("centre of mass of a mesh without volume");
  return reference + moment / total;
}

Eigen::Matrix3d inertia(const TriangleMesh& mesh) {
  // The second moments of a tetrahedron with one corner at the origin: det / 120 (sum of the corners' outer products
  // and of the outer product of their sum).
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Eigen::Vector3d sum = a + b + c;
    moments +=
        a.dot(b.cross(c)) / 120.0 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
  }
  return moments.trace() * Eigen::Matrix3d::Identity() - moments;
}

double diameter(const TriangleMesh& mesh) { return PointTree(mesh.vertices).diameter(); }

BoundingBox bounding_box(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) throw std::invalid_argument("bounding box of an empty mesh");
  BoundingBox box{mesh.vertices.front(), mesh.vertices.front()};
  for (const Eigen::Vector3d& v : mesh.vertices) {
    box.min = box.min.cwiseMin(v);
    box.max = box.max.cwiseMax(v);
  }
  return box;
}

double surface_area(const TriangleMesh& mesh) {
  double area = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles) area += area_vector(mesh, t).norm();
  return area;
}

bool is_closed(const TriangleMesh& mesh) { return !mesh.triangles.empty() && surface_faults(mesh).none(); }

bool is_convex(const TriangleMesh& mesh, double tolerance) {
  const BoundingBox box = mesh.vertices.empty() ? BoundingBox{} : bounding_box(mesh);
  const double allowed = tolerance * (box.max - box.min).norm();
  const PointTree tree(mesh.vertices);
  // Planes that differ by no more than a hundredth of the tolerance are one: faces may be made of very many triangles.
  const double normal_step = 1e-2 * tolerance, offset_step = 1e-2 * allowed;
  const Eigen::Vector3d centre = (box.max + box.min) / 2.0;
  std::unordered_set<std::array<long, 4>, PlaneHash> seen;
  return std::none_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Eigen::Vector3i& t) {
    const Eigen::Vector3d normal = area_vector(mesh, t).normalized();
    const double offset = normal.dot(mesh.vertices[t[0]] - centre);
    if (tolerance > 0.0 && allowed > 0.0) {
      const Eigen::Vector3d n = normal / normal_step;
      if (!seen.insert({std::lround(n.x()), std::lround(n.y()), std::lround(n.z()), std::lround(offset / offset_step)})
               .second) {
        return false;
      }
    }
    return tree.any_beyond(normal, normal.dot(mesh.vertices[t[0]]) + allowed);
  });
}

TriangleMesh weld(const TriangleMesh& mesh) {
  const std::vector<int> ids = position_ids(mesh);
  std::vector<int> new_index(mesh.vertices.size(), -1);
  TriangleMesh welded;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3i merged(ids[t[0]], ids[t[1]], ids[t[2]]);
    if (merged[0] == merged[1] || merged[1] == merged[2] || merged[2] == merged[0]) continue;
    Eigen::Vector3i triangle;
    for (int k = 0; k < 3; ++k) {
      int& index = new_index[merged[k]];
      if (index < 0) {
        index = static_cast<int>(welded.vertices.size());
        welded.vertices.push_back(mesh.vertices[merged[k]]);
      }
      triangle[k] = index;
    }
    welded.triangles.push_back(triangle);
  }
  return welded;
}

TriangleMesh translated(TriangleMesh mesh, const Eigen::Vector3d& t) {
  for (Eigen::Vector3d& v : mesh.vertices) v += t;
  return mesh;
}

TriangleMesh scaled(TriangleMesh mesh, const Eigen::Vector3d& factors) {
  for (Eigen::Vector3d& v : mesh.vertices) v = v.cwiseProduct(factors);
  return mesh;
}

std::vector<SurfaceSample> sample_surface(const TriangleMesh& mesh, int count, Rng& rng) {
  std::vector<double> cumulative_area;
  cumulative_area.reserve(mesh.triangles.size());
  double total = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles) cumulative_area.push_back(total += area_vector(mesh, t).norm());
  if (!(total > 0.0)) throw std::invalid_argument("sampling a mesh without surface");

  std::vector<SurfaceSample> samples;
  samples.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const double area = uniform(rng, 0.0, total);
    const auto at = std::upper_bound(cumulative_area.begin(), cumulative_area.end(), area);
    const Eigen::Vector3i& t =
        mesh.triangles[std::min<std::size_t>(at - cumulative_area.begin(), mesh.triangles.size() - 1)];
    double u = uniform(rng), v = uniform(rng);
    if (u + v > 1.0) {
      u = 1.0 - u;
      v = 1.0 - v;
    }
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    samples.push_back(
        {a + u * (mesh.vertices[t[1]] - a) + v * (mesh.vertices[t[2]] - a), area_vector(mesh, t).normalized()});
  }
  return samples;
}

}  // namespace dofusion
