#include "stability/convex_hull.h"

#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>

extern "C" {
#include <libqhull_r/qhull_ra.h>
}

namespace dofusion {
namespace {

// Qhull's state, with its memory and its message file freed whatever happens.
struct QhullRun {
  qhT state{};
  std::FILE* messages = std::fopen("/dev/null", "w");
  QhullRun() { qh_zero(&state, messages); }
  ~QhullRun() {
    qh_freeqhull(&state, !qh_ALL);
    int rest = 0, total = 0;
    qh_memfreeshort(&state, &rest, &total);
    if (messages != nullptr) std::fclose(messages);
  }
  QhullRun(const QhullRun&) = delete;
  QhullRun& operator=(const QhullRun&) = delete;
};

}  // namespace

TriangleMesh convex_hull(const std::vector<Eigen::Vector3d>& points, const ConvexHullOptions& options) {
  if (points.size() < 4) throw std::invalid_argument("convex hull of fewer than four points");
  std::vector<coordT> coordinates;
  coordinates.reserve(points.size() * 3);
  for (const Eigen::Vector3d& p : points) {
    if (!p.allFinite()) throw std::invalid_argument("convex hull of a point that is not finite");
    coordinates.insert(coordinates.end(), p.data(), p.data() + 3);
  }
  QhullRun run;
  qhT* qh = &run.state;
  std::string command = "qhull Qt Pp";
  if (options.max_corners > 4) command += " TA" + std::to_string(options.max_corners - 4);  // added to a tetrahedron
  if (options.flatness > 0.0) {
    char outside[32];
    std::snprintf(outside, sizeof outside, " W%.6e", options.flatness);
    command += outside;
  }
  if (qh_new_qhull(qh, 3, static_cast<int>(points.size()), coordinates.data(), False, command.data(), nullptr,
                   run.messages) != 0) {
    throw std::invalid_argument("convex hull of points that span no volume");
  }

  TriangleMesh hull;
  std::vector<int> corner_of_point(points.size(), -1);
  facetT* facet = nullptr;
  FORALLfacets {
    vertexT *vertex = nullptr, **vertexp = nullptr;
    setT* vertices = qh_facet3vertex(qh, facet);  // in order, counter-clockwise from outside or the reverse
    std::vector<int> triangle;
    FOREACHvertex_(vertices) {
      int& corner = corner_of_point[static_cast<std::size_t>(qh_pointid(qh, vertex->point))];
      if (corner < 0) {
        corner = static_cast<int>(hull.vertices.size());
        hull.vertices.push_back(points[static_cast<std::size_t>(qh_pointid(qh, vertex->point))]);
      }
      triangle.push_back(corner);
    }
    qh_settempfree(qh, &vertices);
    if (triangle.size() != 3) continue;
    const Eigen::Vector3d &a = hull.vertices[triangle[0]], &b = hull.vertices[triangle[1]],
                          &c = hull.vertices[triangle[2]];
    const Eigen::Vector3d outward(facet->normal[0], facet->normal[1], facet->normal[2]);
    if ((b - a).cross(c - a).dot(outward) < 0.0) std::swap(triangle[1], triangle[2]);
    hull.triangles.emplace_back(triangle[0], triangle[1], triangle[2]);
  }
  return hull;
}

}  // namespace dofusion
