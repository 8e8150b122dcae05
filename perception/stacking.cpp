#include "perception/stacking.h"

#include <algorithm>
#include <numeric>

#include "perception/shape_score.h"

namespace dofusion {
namespace {

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();
constexpr double kContactGap = 1e-4;  // metres between an object and the one it stands on
constexpr double kSameHeight = 0.01;  // metres; supports of about this height carry together

// A body that an object may stand on: its height under the object's readings.
struct Support {
  double height = 0.0;
  const Body* body = nullptr;  // none: the table
};

// The bodies that carry enough of the object's readings and end below its visible foot, the highest first; the table
// comes last.
std::vector<Support> find_supports(const ObjectView& view, const std::vector<Body>& bodies,
                                   const UnknownRecoveryOptions& options) {
  constexpr double kAbove = 10.0;  // metres; higher than any object
  constexpr std::size_t kEnough = 400;
  const double reach = view.lowest + options.contact + 3.0 * quantile(view.sigma, 0.5);
  const std::size_t step = view.points.size() / kEnough + 1;
  std::vector<Support> supports;
  for (const Body& body : bodies) {
    const std::vector<HalfSpace> planes = half_spaces(body.shape.mesh);
    int carried = 0, all = 0;
    double highest = 0.0;
    for (std::size_t i = 0; i < view.points.size(); i += step) {
      ++all;
      const Eigen::Vector3d above(view.points[i].x(), view.points[i].y(), kAbove);
      const std::optional<double> fall = enter(planes, above, -kUp);
      if (!fall) continue;
      ++carried;
      highest = std::max(highest, kAbove - *fall);
    }
    if (carried >= options.rests_on * all && highest <= reach) supports.push_back({highest + kContactGap, &body});
  }
  std::stable_sort(supports.begin(), supports.end(),
                   [](const Support& a, const Support& b) { return a.height > b.height; });
  supports.push_back({0.0, nullptr});
  return supports;
}

Polygon footprint(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector2d> points;
  for (const Eigen::Vector3d& v : mesh.vertices) points.push_back(v.head<2>());
  return convex_hull_2d(std::move(points));
}

Polygon common_footprint(const TriangleMesh& a, const TriangleMesh& b) {
  Polygon common = footprint(a);
  for (const HalfPlane& side : half_planes(footprint(b))) {
    if (!common.empty()) common = clipped(common, side);
  }
  return common;
}

// The shape's centre of mass lies above what it has in common with the bodies of about the support's height.
bool is_balanced(const FittedShape& shape, const std::vector<Support>& supports, const Support& support) {
  if (support.body == nullptr) return true;
  std::vector<Eigen::Vector2d> contact;
  for (const Support& other : supports) {
    if (other.body == nullptr || std::abs(other.height - support.height) > kSameHeight) continue;
    const Polygon common = common_footprint(shape.mesh, other.body->shape.mesh);
    contact.insert(contact.end(), common.begin(), common.end());
  }
  return contains(convex_hull_2d(std::move(contact)), centre_of_mass(shape.mesh).head<2>());
}

bool rests_on(const TriangleMesh& upper, const TriangleMesh& lower) {
  const double gap = bounding_box(upper).min.z() - bounding_box(lower).max.z();
  return std::abs(gap) < kSameHeight && !common_footprint(upper, lower).empty();
}

// What acts on a body's support: the body and everything that rests on it.
struct Load {
  double volume = 0.0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();  // volume times centre
};

Load load_of(std::size_t body, const std::vector<Body>& bodies) {
  const TriangleMesh& mesh = bodies[body].shape.mesh;
  Load load{volume(mesh), volume(mesh) * centre_of_mass(mesh)};
  for (std::size_t upper = 0; upper < bodies.size(); ++upper) {
    if (upper == body || bounding_box(bodies[upper].shape.mesh).min.z() <= bounding_box(mesh).min.z()) continue;
    if (!rests_on(bodies[upper].shape.mesh, mesh)) continue;
    const Load more = load_of(upper, bodies);
    load.volume += more.volume;
    load.moment += more.moment;
  }
  return load;
}

// The load's centre lies above the contact with all that carries the body, by a margin.
bool is_carried(std::size_t body, const std::vector<Body>& bodies, double margin) {
  std::vector<Eigen::Vector2d> contact;
  for (std::size_t lower = 0; lower < bodies.size(); ++lower) {
    if (lower == body || !rests_on(bodies[body].shape.mesh, bodies[lower].shape.mesh)) continue;
    const Polygon common = common_footprint(bodies[body].shape.mesh, bodies[lower].shape.mesh);
    contact.insert(contact.end(), common.begin(), common.end());
  }
  const Load load = load_of(body, bodies);
  const Eigen::Vector2d centre = load.moment.head<2>() / load.volume;
  const Polygon polygon = convex_hull_2d(std::move(contact));
  const std::vector<HalfPlane> sides = half_planes(polygon);
  return polygon.size() >= 3 && std::all_of(sides.begin(), sides.end(), [&](const HalfPlane& side) {
           return side.normal.dot(centre) <= side.offset - margin;
         });
}

bool overlaps_others(std::size_t body, const std::vector<Body>& bodies, double tolerance) {
  for (std::size_t other = 0; other < bodies.size(); ++other) {
    if (other != body && find_overlap(bodies[body].shape.mesh, bodies[other].shape.mesh).depth > tolerance) return true;
  }
  return false;
}

// Deeper than neighbours that touch may seem to overlap.
bool cuts_into(const TriangleMesh& mesh, const std::vector<Body>& bodies) {
  constexpr double kDeep = 0.008;  // metres
  return std::any_of(bodies.begin(), bodies.end(),
                     [&](const Body& body) { return find_overlap(mesh, body.shape.mesh).depth > kDeep; });
}

// The shortest lengthening of `lower`, to any side, that carries `upper`; false if there is none.
bool lengthen(std::size_t lower, std::size_t upper, std::vector<Body>& bodies, const ShapeEvidence& evidence,
              const UnknownRecoveryOptions& options) {
  constexpr double kStep = 0.005;          // metres
  constexpr double kContradiction = 0.01;  // of the score
  const TriangleMesh seen = bodies[lower].shape.mesh;
  const double seen_score = score_shape(seen, bodies[lower].view, evidence, options.shape.slack);
  for (double length = kStep; length <= options.max_extension; length += kStep) {
    for (int i = 0; i < 6; ++i) {
      const Eigen::Vector3d axis = (i % 2 == 0 ? 1.0 : -1.0) * bodies[lower].shape.R.col(i / 2);
      if (std::abs(axis.z()) > 0.1) continue;
      std::vector<Eigen::Vector3d> points = seen.vertices;
      for (const Eigen::Vector3d& v : seen.vertices) points.push_back(v + length * axis);
      const std::optional<TriangleMesh> longer = solid_hull(points);
      if (!longer) continue;
      bodies[lower].shape.mesh = *longer;
      if (is_carried(upper, bodies, options.balance) && !overlaps_others(lower, bodies, options.overlap) &&
          score_shape(*longer, bodies[lower].view, evidence, options.shape.slack) > seen_score - kContradiction) {
        return true;
      }
    }
  }
  bodies[lower].shape.mesh = seen;
  return false;
}

}  // namespace

bool is_high_enough(const TriangleMesh& mesh, double min_size) {
  const BoundingBox box = bounding_box(mesh);
  return box.max.z() - box.min.z() >= min_size;
}

std::optional<FittedShape> fit_on_support(const ObjectView& view, const std::vector<Body>& bodies,
                                          const ShapeEvidence& evidence, const UnknownRecoveryOptions& options) {
  constexpr double kTips = 0.15;  // of the score
  constexpr double kCutsIn = 0.25;
  std::optional<FittedShape> best;
  double best_score = 0.0;
  const std::vector<Support> supports = find_supports(view, bodies, options);
  for (const Support& support : supports) {
    std::optional<FittedShape> shape = fit_shape(view, support.height, evidence, options.shape);
    if (!shape || !is_high_enough(shape->mesh, options.min_size)) continue;
    const bool balanced = is_balanced(*shape, supports, support);
    const double score = shape->score - (balanced ? 0.0 : kTips) - (cuts_into(shape->mesh, bodies) ? kCutsIn : 0.0);
    if (!best || score > best_score) best = shape, best_score = score;
    if (balanced && support.body != nullptr) break;
  }
  return best;
}

void extend_hidden_supports(std::vector<Body>& bodies, const ShapeEvidence& evidence,
                            const UnknownRecoveryOptions& options) {
  std::vector<std::size_t> from_top(bodies.size());
  std::iota(from_top.begin(), from_top.end(), 0);
  std::stable_sort(from_top.begin(), from_top.end(), [&](std::size_t a, std::size_t b) {
    return bounding_box(bodies[a].shape.mesh).min.z() > bounding_box(bodies[b].shape.mesh).min.z();
  });
  for (const std::size_t upper : from_top) {
    for (std::size_t lower = 0; lower < bodies.size(); ++lower) {
      if (lower == upper || !rests_on(bodies[upper].shape.mesh, bodies[lower].shape.mesh)) continue;
      if (is_carried(upper, bodies, options.balance)) break;
      lengthen(lower, upper, bodies, evidence, options);
    }
  }
}

}  // namespace dofusion
