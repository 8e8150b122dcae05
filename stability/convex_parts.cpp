#include "stability/convex_parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "stability/convex_hull.h"
#include "stability/convex_split.h"
#include "stability/mesh_rays.h"

namespace dofusion {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDominantShare = 0.08;  // of the surface: a direction that so much of it faces is worth cutting across
constexpr std::size_t kTrianglesTriedTwice = 20000;  // at most: two ways of choosing cuts, the better one kept
constexpr int kCellsPerPart = 3;                     // cut finer than asked for: what was cut in vain is joined again

struct Facing {
  Vector3d normal;
  double area = 0.0;
};

// The direction, up to its sign, that most of the surface faces, among those at right angles to `across` (if not zero).
Facing dominant_direction(const std::vector<Facing>& faces, const Vector3d& across) {
  const auto allowed = [&](const Facing& f) { return std::abs(f.normal.dot(across)) < 1e-3; };
  std::map<std::array<long, 3>, double> areas;  // over a grid of directions
  constexpr double kGrid = 50.0;
  const auto key_of = [](const Vector3d& n) {
    return std::array<long, 3>{std::lround(n.x() * kGrid), std::lround(n.y() * kGrid), std::lround(n.z() * kGrid)};
  };
  for (const Facing& f : faces) {
    if (allowed(f)) areas[key_of(f.normal)] += f.area;
  }
  if (areas.empty()) return {};
  const auto largest =
      std::max_element(areas.begin(), areas.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  const Vector3d seed = Vector3d(static_cast<double>(largest->first[0]), static_cast<double>(largest->first[1]),
                                 static_cast<double>(largest->first[2]))
                            .normalized();
  // Narrowed in steps, so that an exact face gives its exact normal.
  Facing found{seed, 0.0};
  for (const double within : {0.03, 0.01, 1e-3, 1e-4}) {
    Vector3d sum = Vector3d::Zero();
    double area = 0.0;
    for (const Facing& f : faces) {
      if (!allowed(f) || (f.normal - found.normal).norm() > within) continue;
      sum += f.area * f.normal;
      area += f.area;
    }
    if (!(area > 0.5 * found.area)) break;  // faces that only happen to be alike
    found = {sum.normalized(), area};
  }
  return found;
}

// The axes to cut across, as the rows of a rotation.
Matrix3d cutting_frame(const TriangleMesh& mesh) {
  std::vector<Facing> faces;
  double total = 0.0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Vector3d& a = mesh.vertices[t[0]];
    const Vector3d area = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a) / 2.0;
    if (!(area.norm() > 0.0)) continue;
    Vector3d n = area.normalized();
    int largest = 0;
    n.cwiseAbs().maxCoeff(&largest);
    faces.push_back({n[largest] < 0.0 ? Vector3d(-n) : n, area.norm()});
    total += area.norm();
  }
  const Matrix3d moments = inertia(translated(mesh, -centre_of_mass(mesh)));
  const Matrix3d principal = Eigen::SelfAdjointEigenSolver<Matrix3d>(moments).eigenvectors();
  Facing first = dominant_direction(faces, Vector3d::Zero());
  if (first.area < kDominantShare * total) first.normal = principal.col(0);
  Facing second = dominant_direction(faces, first.normal);
  if (second.area < kDominantShare / 2.0 * total) {
    int most_across = 0;
    (principal.transpose() * first.normal).cwiseAbs().minCoeff(&most_across);
    second.normal = principal.col(most_across);
  }
  Matrix3d frame;
  frame.row(0) = first.normal;
  frame.row(1) = (second.normal - second.normal.dot(first.normal) * first.normal).normalized();
  frame.row(2) = frame.row(0).cross(frame.row(1));
  // Axes as they are keep their coordinates to the last digit.
  const Matrix3d rounded = frame.array().round().matrix();
  return (frame - rounded).norm() < 1e-9 ? rounded : frame;
}

TriangleMesh rotated(TriangleMesh mesh, const Matrix3d& R) {
  for (Vector3d& v : mesh.vertices) v = R * v;
  return mesh;
}

// A piece; `done` if it is too thin to be cut.
struct Work {
  SolidCell cell;
  bool done = false;
};

std::vector<SolidCell> cut_up(const CellSplitter& splitter, const ConvexPartsOptions& options) {
  std::vector<Work> work = {{splitter.whole(), false}};
  const double allowed = options.tolerance * work.front().cell.volume;
  const std::size_t most = static_cast<std::size_t>(options.max_parts) * kCellsPerPart;
  while (work.size() < most && options.max_parts > 1) {
    double excess = 0.0;
    Work* worst = nullptr;
    for (Work& w : work) {
      excess += w.cell.excess();
      if (!w.done && (worst == nullptr || w.cell.excess() > worst->cell.excess())) worst = &w;
    }
    if (excess <= allowed || worst == nullptr || worst->cell.excess() <= 0.0) break;
    std::optional<CellPair> halves = splitter.split(worst->cell);
    worst->done = true;
    if (!halves) continue;
    // An empty side is still a gain: the box has become tighter. It is dropped.
    std::vector<SolidCell> pieces;
    for (SolidCell* side : {&halves->below, &halves->above}) {
      if (!side->hull.triangles.empty()) pieces.push_back(std::move(*side));
    }
    if (pieces.empty()) continue;
    *worst = {std::move(pieces.front()), false};
    if (pieces.size() > 1) work.push_back({std::move(pieces.back()), false});
  }
  std::vector<SolidCell> cells;
  for (Work& w : work) cells.push_back(std::move(w.cell));
  return cells;
}

struct Piece {
  TriangleMesh hull;
  double volume = 0.0;  // of the hull
  Eigen::AlignedBox3d box;
};

Piece joined(const Piece& a, const Piece& b, double flatness) {
  std::vector<Vector3d> points = a.hull.vertices;
  points.insert(points.end(), b.hull.vertices.begin(), b.hull.vertices.end());
  Piece piece;
  piece.hull = convex_hull(points, {0, flatness});
  piece.volume = volume(piece.hull);
  piece.box = a.box.merged(b.box);
  return piece;
}

// Joins pieces, always the two whose hull adds least, as long as there are too many or the excess stays allowed.
class Joiner {
 public:
  Joiner(std::vector<Piece> pieces, double flatness) : pieces_(std::move(pieces)), flatness_(flatness) {
    added_.assign(pieces_.size(), std::vector<double>(pieces_.size(), kUnknown));
  }

  std::vector<Piece> run(std::size_t most, double allowed) {
    while (pieces_.size() > 1) {
      std::optional<Choice> best = cheapest(true);
      if (!best && pieces_.size() > most) best = cheapest(false);  // apart from one another
      if (!best || (pieces_.size() <= most && best->added > allowed)) break;
      allowed -= best->added;
      pieces_[best->a] = joined(pieces_[best->a], pieces_[best->b], flatness_);
      remove(best->b);
      for (std::size_t i = 0; i < pieces_.size(); ++i) added_[best->a][i] = added_[i][best->a] = kUnknown;
    }
    return std::move(pieces_);
  }

 private:
  static constexpr double kUnknown = std::numeric_limits<double>::infinity();
  struct Choice {
    std::size_t a, b;
    double added;
  };

  bool touch(const Piece& a, const Piece& b) const {
    return a.box.squaredExteriorDistance(b.box) <= flatness_ * flatness_;
  }

  std::optional<Choice> cheapest(bool touching_only) {
    std::optional<Choice> best;
    for (std::size_t a = 0; a < pieces_.size(); ++a) {
      for (std::size_t b = a + 1; b < pieces_.size(); ++b) {
        if (touching_only && !touch(pieces_[a], pieces_[b])) continue;
        double& added = added_[a][b];
        if (added == kUnknown) {
          added = joined(pieces_[a], pieces_[b], flatness_).volume - pieces_[a].volume - pieces_[b].volume;
        }
        if (!best || added < best->added) best = Choice{a, b, added};
      }
    }
    return best;
  }

  void remove(std::size_t index) {
    const auto at = static_cast<std::ptrdiff_t>(index);
    pieces_.erase(pieces_.begin() + at);
    added_.erase(added_.begin() + at);
    for (auto& row : added_) row.erase(row.begin() + at);
  }

  std::vector<Piece> pieces_;
  double flatness_;
  std::vector<std::vector<double>> added_;  // volume that joining a and b > a adds
};

struct Decomposition {
  std::vector<Piece> pieces;
  double excess = 0.0;  // of their volumes over the solid's
};

Decomposition decompose(const TriangleMesh& mesh, double worse_side_weight, double solid,
                        const ConvexPartsOptions& options) {
  const CellSplitter splitter(mesh, worse_side_weight);
  std::vector<Piece> pieces;
  double hulls = 0.0;
  for (const SolidCell& cell : cut_up(splitter, options)) {
    pieces.push_back({cell.hull, cell.hull_volume, cell.box});
    hulls += cell.hull_volume;
  }
  const double allowed = std::max(options.tolerance * solid - (hulls - solid), 0.0);
  Decomposition result;
  result.pieces =
      Joiner(std::move(pieces), splitter.flatness()).run(static_cast<std::size_t>(options.max_parts), allowed);
  for (const Piece& piece : result.pieces) result.excess += piece.volume;
  result.excess -= solid;
  return result;
}

// Fewer parts, of those whose excess is allowed; else the smaller excess.
bool better(const Decomposition& a, const Decomposition& b, double allowed) {
  if (a.excess <= allowed && b.excess <= allowed && a.pieces.size() != b.pieces.size()) {
    return a.pieces.size() < b.pieces.size();
  }
  return a.excess < b.excess;
}

void check(const TriangleMesh& mesh, const ConvexPartsOptions& options) {
  if (options.max_parts < 1)
    throw std::invalid_argument("convex parts: max_parts is " + std::to_string(options.max_parts));
  if (options.max_corners < 5) {
    throw std::invalid_argument("convex parts: max_corners is " + std::to_string(options.max_corners));
  }
  if (!(options.tolerance >= 0.0)) throw std::invalid_argument("convex parts: the tolerance is negative");
  if (!is_closed(mesh)) throw std::invalid_argument("convex parts of a mesh that is not closed");
  if (!(volume(translated(mesh, -mesh.vertices.front())) > 0.0)) {
    throw std::invalid_argument("convex parts of a mesh that has no volume or is inside out");
  }
}

using Interval = std::pair<double, double>;

double length(const std::vector<Interval>& intervals) {
  double sum = 0.0;
  for (const Interval& i : intervals) sum += i.second - i.first;
  return sum;
}

// Where the line is in at least one solid.
std::vector<Interval> inside_intervals(const std::vector<RayCrossing>& crossings) {
  std::vector<Interval> intervals;
  int solids = 0;
  for (const RayCrossing& c : crossings) {
    if (solids <= 0 && solids + c.change > 0) intervals.emplace_back(c.x, c.x);
    if (solids > 0 && solids + c.change <= 0) intervals.back().second = c.x;
    solids += c.change;
  }
  return intervals;
}

double common_length(const std::vector<Interval>& a, const std::vector<Interval>& b) {
  double sum = 0.0;
  for (const Interval& i : a) {
    for (const Interval& j : b) sum += std::max(0.0, std::min(i.second, j.second) - std::max(i.first, j.first));
  }
  return sum;
}

}  // namespace

std::vector<TriangleMesh> convex_parts(const TriangleMesh& closed_mesh, const ConvexPartsOptions& options) {
  check(closed_mesh, options);
  const Matrix3d R = cutting_frame(closed_mesh);
  const Vector3d origin = bounding_box(closed_mesh).min;  // far from it, volumes would lose digits
  const TriangleMesh mesh = rotated(translated(closed_mesh, -origin), R);
  const double solid = volume(mesh), flatness = 1e-6 * (bounding_box(mesh).max - bounding_box(mesh).min).norm();

  Decomposition best = decompose(mesh, 1.0, solid, options);
  if (mesh.triangles.size() <= kTrianglesTriedTwice && best.excess > 1e-6 * solid) {
    Decomposition other = decompose(mesh, 0.0, solid, options);
    if (better(other, best, options.tolerance * solid)) best = std::move(other);
  }
  std::vector<TriangleMesh> parts;
  for (const Piece& piece : best.pieces) {
    const TriangleMesh part = convex_hull(piece.hull.vertices, {options.max_corners, flatness});
    parts.push_back(translated(rotated(part, R.transpose()), origin));
  }
  return parts;
}

ObjectPtr with_convex_parts(const ObjectPtr& object, const ConvexPartsOptions& options) {
  if (object->convex || !object->parts.empty()) return object;
  auto divided = std::make_shared<Object>(*object);
  divided->parts = convex_parts(object->mesh, options);
  return divided;
}

ConvexFit convex_fit(const TriangleMesh& closed_mesh, const std::vector<TriangleMesh>& parts, int lines_per_side) {
  TriangleMesh all;
  for (const TriangleMesh& part : parts) {
    const Eigen::Vector3i first = Eigen::Vector3i::Constant(static_cast<int>(all.vertices.size()));
    all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
    for (const Eigen::Vector3i& t : part.triangles) all.triangles.push_back(t + first);
  }
  const MeshRays solid_rays(closed_mesh);
  std::optional<MeshRays> part_rays;
  if (!all.triangles.empty()) part_rays.emplace(all);
  TriangleMesh both = closed_mesh;
  both.vertices.insert(both.vertices.end(), all.vertices.begin(), all.vertices.end());
  const BoundingBox box = bounding_box(both);
  double solid = 0.0, added = 0.0, missing = 0.0;
  for (int i = 0; i < lines_per_side; ++i) {
    for (int j = 0; j < lines_per_side; ++j) {
      const double y = box.min.y() + (box.max.y() - box.min.y()) * (i + 0.5) / lines_per_side;
      const double z = box.min.z() + (box.max.z() - box.min.z()) * (j + 0.5) / lines_per_side;
      const auto in_solid = inside_intervals(solid_rays.along_x(y, z));
      const auto in_parts = part_rays ? inside_intervals(part_rays->along_x(y, z)) : std::vector<Interval>{};
      const double common = common_length(in_solid, in_parts);
      solid += length(in_solid);
      added += length(in_parts) - common;
      missing += length(in_solid) - common;
    }
  }
  if (!(solid > 0.0)) throw std::invalid_argument("convex fit to a mesh that encloses nothing");
  return {added / solid, missing / solid};
}

}  // namespace dofusion
