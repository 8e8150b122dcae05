#include "stability/convex_split.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

#include "stability/convex_hull.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

constexpr double kOnPlane = 1e-7;        // diagonals: nearer than this is on a plane (coordinates of files are floats)
constexpr double kThinnest = 2e-3;       // diagonals between two cuts
constexpr int kHullCorners = 600;        // of a cell: a finer hull costs time and is thinned out in the end
constexpr int kEvenCuts = 11;            // per axis
constexpr std::size_t kFaceCuts = 8;     // per axis, along the largest faces
constexpr std::size_t kCornerCuts = 16;  // per axis, at corners, where there are so few
constexpr double kSection = 0.01;     // cost of the cut itself, its area times the cell's diagonal: else across a ring
                                      // is as good as along it
constexpr double kUnevenness = 0.05;  // cost of a cut that leaves one side empty, in volumes of the hull

// Directions to look for extreme points in: the hull of these points stands for that of all.
constexpr int kDirections = 64;
constexpr int kPolygonsLooked = 6000;  // about so many of a cell's are asked for extreme points
using Directions = Eigen::Matrix<double, kDirections, 3>;
using Supports = Eigen::Array<double, kDirections, 1>;

const Directions& directions() {
  static const Directions spread = [] {
    Directions d;
    for (int i = 0; i < kDirections; ++i) {  // a spiral from pole to pole
      const double z = 1.0 - (2.0 * i + 1.0) / kDirections, angle = i * M_PI * (3.0 - std::sqrt(5.0));
      d.row(i) << std::sqrt(1.0 - z * z) * std::cos(angle), std::sqrt(1.0 - z * z) * std::sin(angle), z;
    }
    return d;
  }();
  return spread;
}

// The farthest points in those directions.
struct Extremes {
  Supports support = Supports::Constant(-INFINITY);
  Eigen::Matrix<double, 3, kDirections> at = Eigen::Matrix<double, 3, kDirections>::Zero();

  void add(const Vector3d& p) {
    const Supports value = (directions() * p).array();
    if (!(value > support).any()) return;
    for (int i = 0; i < kDirections; ++i) {
      if (value[i] > support[i]) at.col(i) = p;
    }
    support = support.max(value);
  }
  void add(const Extremes& other) {
    for (int i = 0; i < kDirections; ++i) {
      if (other.support[i] <= support[i]) continue;
      support[i] = other.support[i];
      at.col(i) = other.at.col(i);
    }
  }
  std::vector<Vector3d> points() const {
    std::vector<Vector3d> found;
    for (int i = 0; i < kDirections; ++i) {
      if (std::isfinite(support[i])) found.emplace_back(at.col(i));
    }
    const auto before = [](const Vector3d& a, const Vector3d& b) {
      return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
    };
    std::sort(found.begin(), found.end(), before);
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }
};

// The solid's surface between two neighbouring planes across an axis.
struct Slab {
  double flux = 0.0;    // integral of the normal's part along the axis
  double moment = 0.0;  // the same times the coordinate along the axis
  Extremes extremes;

  void add(const std::vector<Vector3d>& polygon, int axis, bool with_extremes) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const Vector3d& a = polygon[0];
    for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
      const Vector3d &b = polygon[i], &c = polygon[i + 1];
      const double area = ((b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u])) / 2.0;
      flux += area;
      moment += area * (a[axis] + b[axis] + c[axis]) / 3.0;
    }
    if (!with_extremes) return;
    for (const Vector3d& p : polygon) extremes.add(p);
  }
};

// Cuts a convex polygon that has points on both sides of the plane.
void cut_polygon(const std::vector<Vector3d>& polygon, int axis, double plane, double on_plane,
                 std::vector<Vector3d>& below, std::vector<Vector3d>& above) {
  below.clear();
  above.clear();
  const auto side = [&](const Vector3d& p) {
    const double d = p[axis] - plane;
    return std::abs(d) <= on_plane ? 0.0 : d;
  };
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector3d &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
    const double dp = side(p), dq = side(q);
    if (dp <= 0.0) below.push_back(p);
    if (dp >= 0.0) above.push_back(p);
    if (dp * dq >= 0.0) continue;
    Vector3d crossing = p + dp / (dp - dq) * (q - p);
    crossing[axis] = plane;
    below.push_back(crossing);
    above.push_back(crossing);
  }
}

// Calls take(slab, polygon) for what lies of a polygon in each slab: slab k lies below plane k, the last above all. A
// polygon in a plane belongs to the side that the solid is on.
template <typename Take>
void slice(std::vector<Vector3d>& polygon, const Vector3d& normal, int axis, const std::vector<double>& planes,
           double on_plane, Take take) {
  double low = polygon[0][axis], high = low;
  for (const Vector3d& p : polygon) {
    low = std::min(low, p[axis]);
    high = std::max(high, p[axis]);
  }
  std::size_t k =
      static_cast<std::size_t>(std::upper_bound(planes.begin(), planes.end(), low + on_plane) - planes.begin());
  if (k > 0 && high <= planes[k - 1] + on_plane) {  // in the plane
    take(normal[axis] > 0.0 ? k - 1 : k, polygon);
    return;
  }
  std::vector<Vector3d> below, above;
  for (; k < planes.size() && planes[k] < high - on_plane; ++k) {
    cut_polygon(polygon, axis, planes[k], on_plane, below, above);
    take(k, below);
    polygon.swap(above);
  }
  take(k, polygon);
}

double hull_volume(const std::vector<Vector3d>& points) {
  if (points.size() < 4) return 0.0;
  try {
    return volume(convex_hull(points));
  } catch (const std::invalid_argument&) {
    return 0.0;  // flat
  }
}

std::vector<Vector3d> unit_normals(const TriangleMesh& mesh) {
  std::vector<Vector3d> normals;
  normals.reserve(mesh.triangles.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Vector3d& a = mesh.vertices[t[0]];
    normals.push_back((mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).normalized());
  }
  return normals;
}

void append(SurfacePieces& pieces, const std::vector<Vector3d>& polygon, int triangle) {
  pieces.points.insert(pieces.points.end(), polygon.begin(), polygon.end());
  pieces.start.push_back(static_cast<int>(pieces.points.size()));
  pieces.triangle.push_back(triangle);
}

void polygon_of(const SurfacePieces& pieces, int index, std::vector<Vector3d>& polygon) {
  polygon.assign(pieces.points.begin() + pieces.start[index], pieces.points.begin() + pieces.start[index + 1]);
}

// Cuts at coordinates of faces across the axis, the largest first.
std::vector<double> face_planes(const SurfacePieces& pieces, const std::vector<Vector3d>& normals, int axis,
                                double grid) {
  struct Face {
    double area = 0.0, moment = 0.0;
  };
  std::map<long, Face> faces;
  for (int i = 0; i < pieces.size(); ++i) {
    if (std::abs(normals[pieces.triangle[i]][axis]) < 0.9999) continue;
    Slab face;
    std::vector<Vector3d> polygon;
    const Vector3d& a = pieces.points[pieces.start[i]];
    double area = 0.0;
    for (int k = pieces.start[i] + 1; k + 1 < pieces.start[i + 1]; ++k) {
      area += (pieces.points[k] - a).cross(pieces.points[k + 1] - a).norm() / 2.0;
    }
    Face& at = faces[std::lround(a[axis] / grid)];
    at.area += area;
    at.moment += area * a[axis];
  }
  std::vector<Face> largest;
  for (const auto& [key, face] : faces) {
    if (face.area > 0.0) largest.push_back(face);
  }
  std::stable_sort(largest.begin(), largest.end(), [](const Face& a, const Face& b) { return a.area > b.area; });
  std::vector<double> planes;
  for (const Face& face : largest) planes.push_back(face.moment / face.area);
  planes.resize(std::min(planes.size(), kFaceCuts));
  return planes;
}

// Coordinates of the corners, if there are few different ones.
std::vector<double> corner_planes(const SurfacePieces& pieces, int axis, double grid) {
  std::map<long, double> found;
  for (const Vector3d& p : pieces.points) {
    found.emplace(std::lround(p[axis] / grid), p[axis]);
    if (found.size() > kCornerCuts) return {};
  }
  std::vector<double> planes;
  for (const auto& [key, at] : found) planes.push_back(at);
  return planes;
}

}  // namespace

CellSplitter::CellSplitter(const TriangleMesh& closed_mesh, double worse_side_weight)
    : worse_side_weight_(worse_side_weight),
      mesh_(closed_mesh),
      normals_(unit_normals(closed_mesh)),
      rays_(closed_mesh) {
  const BoundingBox box = bounding_box(mesh_);
  size_ = (box.max - box.min).norm();
  directions();
}

double CellSplitter::cost_of(const SolidCell& cell, const Cut& cut, double hull_below, double hull_above) const {
  const double worst = std::max(hull_below - cut.volume_below, hull_above - (cell.volume - cut.volume_below));
  const double unevenness = std::abs(2.0 * cut.volume_below / cell.volume - 1.0);
  return hull_below + hull_above + worse_side_weight_ * std::max(worst, 0.0) +
         kUnevenness * unevenness * cell.hull_volume + kSection * cut.section * cell.box.diagonal().norm();
}

SolidCell CellSplitter::whole() const {
  SolidCell cell;
  for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
    const Eigen::Vector3i& t = mesh_.triangles[i];
    append(cell.surface, {mesh_.vertices[t[0]], mesh_.vertices[t[1]], mesh_.vertices[t[2]]}, static_cast<int>(i));
    for (int k = 0; k < 3; ++k) cell.box.extend(mesh_.vertices[t[k]]);
  }
  cell.volume = volume(translated(mesh_, -cell.box.center()));
  find_hull(cell);
  return cell;
}

void CellSplitter::add_inner_corners(const Eigen::AlignedBox3d& box, std::vector<Vector3d>& points) const {
  for (int i = 0; i < 8; ++i) {
    const Vector3d corner = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i));
    // Looked at a little inside the box: the corner itself often lies on the surface.
    if (rays_.inside(corner + 1e-5 * (box.center() - corner))) points.push_back(corner);
  }
}

void CellSplitter::find_hull(SolidCell& cell) const {
  std::vector<Vector3d> points = cell.surface.points;
  add_inner_corners(cell.box, points);
  cell.hull = {};
  cell.hull_volume = 0.0;
  try {
    if (points.size() >= 4) cell.hull = convex_hull(points, {kHullCorners, flatness()});
    cell.hull_volume = volume(cell.hull);
  } catch (const std::invalid_argument&) {  // flat: nothing of the solid is here
  }
}

std::vector<double> CellSplitter::candidates(const SolidCell& cell, int axis) const {
  const double low = cell.box.min()[axis], high = cell.box.max()[axis], margin = kThinnest * size_;
  std::vector<double> wanted = face_planes(cell.surface, normals_, axis, 1e-6 * size_);
  const std::vector<double> corners = corner_planes(cell.surface, axis, 1e-6 * size_);
  wanted.insert(wanted.end(), corners.begin(), corners.end());
  for (int i = 1; i <= kEvenCuts; ++i) wanted.push_back(low + (high - low) * i / (kEvenCuts + 1));
  std::vector<double> planes;
  for (const double plane : wanted) {
    const auto near = [&](double other) { return std::abs(plane - other) < margin; };
    if (plane > low + margin && plane < high - margin && std::none_of(planes.begin(), planes.end(), near)) {
      planes.push_back(plane);
    }
  }
  std::sort(planes.begin(), planes.end());
  return planes;
}

std::optional<Cut> CellSplitter::best_cut_across(const SolidCell& cell, int axis) const {
  const std::vector<double> planes = candidates(cell, axis);
  if (planes.empty()) return std::nullopt;
  std::vector<Slab> slabs(planes.size() + 1);
  std::vector<Vector3d> polygon;
  const int stride = 1 + cell.surface.size() / kPolygonsLooked;
  for (int i = 0; i < cell.surface.size(); ++i) {
    polygon_of(cell.surface, i, polygon);
    slice(polygon, normals_[cell.surface.triangle[i]], axis, planes, kOnPlane * size_,
          [&](std::size_t k, const std::vector<Vector3d>& part) { slabs[k].add(part, axis, i % stride == 0); });
  }
  std::vector<Extremes> above(slabs.size());  // above[k]: of slabs k, k + 1, …
  for (std::size_t k = slabs.size(); k-- > 0;) {
    if (k + 1 < slabs.size()) above[k] = above[k + 1];
    above[k].add(slabs[k].extremes);
  }
  // The solid's cross-section at the cell's lower end, from the divergence theorem over the cell: with the field
  // (x - high) along the axis, the upper end has no part in it.
  const double low = cell.box.min()[axis], high = cell.box.max()[axis];
  double flux = 0.0, moment = 0.0;
  for (const Slab& slab : slabs) {
    flux += slab.flux;
    moment += slab.moment;
  }
  const double lowest_section = (cell.volume - moment + high * flux) / (high - low);

  std::optional<Cut> best;
  Extremes below;
  flux = moment = 0.0;
  for (std::size_t k = 0; k < planes.size(); ++k) {
    below.add(slabs[k].extremes);
    flux += slabs[k].flux;
    moment += slabs[k].moment;
    Cut cut{axis, planes[k]};
    cut.volume_below = moment - planes[k] * flux + (planes[k] - low) * lowest_section;
    cut.section = lowest_section - flux;
    Eigen::AlignedBox3d box_below = cell.box, box_above = cell.box;
    box_below.max()[axis] = box_above.min()[axis] = planes[k];
    std::vector<Vector3d> points_below = below.points(), points_above = above[k + 1].points();
    add_inner_corners(box_below, points_below);
    add_inner_corners(box_above, points_above);
    cut.cost = cost_of(cell, cut, hull_volume(points_below), hull_volume(points_above));
    if (!best || cut.cost < best->cost) best = cut;
  }
  return best;
}

std::optional<CellPair> CellSplitter::split(const SolidCell& cell) const {
  std::optional<CellPair> best;
  double best_cost = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::optional<Cut> cut = best_cut_across(cell, axis);
    if (!cut) continue;
    CellPair halves = split_at(cell, *cut);
    const double cost = cost_of(cell, *cut, halves.below.hull_volume, halves.above.hull_volume);
    if (best && cost >= best_cost) continue;
    best = std::move(halves);
    best_cost = cost;
  }
  return best;
}

CellPair CellSplitter::split_at(const SolidCell& cell, const Cut& cut) const {
  CellPair halves;
  auto& [below, above] = halves;
  below.box = above.box = cell.box;
  below.box.max()[cut.axis] = above.box.min()[cut.axis] = cut.at;
  below.volume = cut.volume_below;
  above.volume = cell.volume - cut.volume_below;
  std::vector<Vector3d> polygon;
  for (int i = 0; i < cell.surface.size(); ++i) {
    const int triangle = cell.surface.triangle[i];
    polygon_of(cell.surface, i, polygon);
    slice(polygon, normals_[triangle], cut.axis, {cut.at}, kOnPlane * size_,
          [&](std::size_t k, const std::vector<Vector3d>& part) {
            append(k == 0 ? below.surface : above.surface, part, triangle);
          });
  }
  find_hull(below);
  find_hull(above);
  return halves;
}

}  // namespace dofusion
