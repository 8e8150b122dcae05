#include "perception/shape_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>

#include "perception/shape_score.h"

namespace dofusion {
namespace {

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();

// What a simpler shape may score less than a freer one.
double preference(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::kUprightBox:
      return 0.10;
    case ShapeKind::kUprightCylinder:
      return 0.08;
    case ShapeKind::kUprightPrism:
      return 0.05;
    case ShapeKind::kTiltedBox:
    case ShapeKind::kLyingPrism:
      return 0.03;
    case ShapeKind::kHull:
      return 0.0;
  }
  return 0.0;
}

struct Circle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 0.0;
};

// Least squares on x^2 + y^2 = 2 c·p + k.
std::optional<Circle> fit_circle(const Polygon& corners) {
  if (corners.size() < 5) return std::nullopt;
  Eigen::MatrixXd A(corners.size(), 3);
  Eigen::VectorXd b(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    A.row(static_cast<Eigen::Index>(i)) << 2.0 * corners[i].x(), 2.0 * corners[i].y(), 1.0;
    b[static_cast<Eigen::Index>(i)] = corners[i].squaredNorm();
  }
  const Eigen::Vector3d x = A.colPivHouseholderQr().solve(b);
  const double square = x[2] + x.head<2>().squaredNorm();
  if (!x.allFinite() || square <= 0.0) return std::nullopt;
  return Circle{x.head<2>(), std::sqrt(square)};
}

// A regular polygon of the circle's area.
Polygon round_polygon(const Circle& circle, int sides) {
  const double step = 2.0 * M_PI / sides;
  const double radius = circle.radius * std::sqrt(step / std::sin(step));
  Polygon polygon;
  for (int i = 0; i < sides; ++i) {
    polygon.push_back(circle.centre + radius * Eigen::Vector2d(std::cos(i * step), std::sin(i * step)));
  }
  return polygon;
}

// Corners of the hull of the points with the most important ones first, until none lies further out than `tolerance`.
std::optional<TriangleMesh> coarse_hull(const std::vector<Eigen::Vector3d>& points,
                                        std::vector<Eigen::Vector3d> corners, double tolerance, int max_corners) {
  const std::optional<TriangleMesh> fine = solid_hull(points);
  if (!fine) return std::nullopt;
  const std::size_t start = corners.size();
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0, 1)}) {
    const auto by_axis = [&](const auto& a, const auto& b) { return axis.dot(a) < axis.dot(b); };
    const auto [low, high] = std::minmax_element(fine->vertices.begin(), fine->vertices.end(), by_axis);
    corners.push_back(*low);
    corners.push_back(*high);
  }
  std::optional<TriangleMesh> hull = solid_hull(corners);
  while (hull && static_cast<int>(hull->vertices.size()) < max_corners && corners.size() < start + 3 * max_corners) {
    const std::vector<HalfSpace> body = half_spaces(*hull);
    double furthest = tolerance;
    const Eigen::Vector3d* next = nullptr;
    for (const Eigen::Vector3d& vertex : fine->vertices) {
      const double out = plane_distance(body, vertex);
      if (out > furthest) furthest = out, next = &vertex;
    }
    if (next == nullptr) break;
    corners.push_back(*next);
    hull = solid_hull(corners);
  }
  return hull ? hull : fine;
}

class ShapeFitter {
 public:
  ShapeFitter(const ObjectView& view, double support, const ShapeEvidence& evidence, const ShapeFitOptions& options)
      : view_(view),
        support_(support),
        evidence_(evidence),
        options_(options),
        tolerance_(3.0 * quantile(view.sigma, 0.5) + options.slack) {}

  std::optional<FittedShape> fit() {
    if (view_.points.size() < 4) return std::nullopt;
    propose_upright();
    propose_lying();
    propose_tilted_boxes();
    propose_hull();
    return best_;
  }

 private:
  bool is_level(const ObservedFace& face) const {
    return face.plane.normal.z() > std::cos(options_.level_deg * M_PI / 180.0);
  }
  bool is_upright(const ObservedFace& face) const {
    return std::abs(face.plane.normal.z()) < std::sin(options_.upright_deg * M_PI / 180.0);
  }
  bool is_large(const ObservedFace& face) const {
    return face.pixels >= options_.min_face_share * view_.faces.front().pixels;
  }

  void propose(std::optional<TriangleMesh> mesh, const Eigen::Matrix3d& R, ShapeKind kind) {
    constexpr double kFloats = 0.002;  // metres
    if (mesh) mesh = cut(*mesh, {-kUp, -support_});
    if (!mesh || bounding_box(*mesh).min.z() > support_ + kFloats) return;
    const double score = score_shape(*mesh, view_, evidence_, options_.slack);
    if (best_ && score + preference(kind) <= best_->score + preference(best_->kind)) return;
    best_ = FittedShape{std::move(*mesh), R, kind, score};
  }

  // The highest large level face, or the highest points.
  double top_height() const {
    double top = -std::numeric_limits<double>::infinity();
    for (const ObservedFace& face : view_.faces) {
      if (is_level(face) && is_large(face)) top = std::max(top, face.centre.z());
    }
    return std::isfinite(top) ? top : robust_range(view_.points, kUp).high;
  }

  bool has_level_face() const {
    return std::any_of(view_.faces.begin(), view_.faces.end(),
                       [&](const ObservedFace& f) { return is_level(f) && is_large(f); });
  }

  std::vector<Eigen::Vector2d> projected(const Eigen::Matrix3d& R) const {
    std::vector<Eigen::Vector2d> points;
    points.reserve(view_.points.size());
    for (const Eigen::Vector3d& p : view_.points) points.push_back((R.transpose() * p).head<2>());
    return points;
  }

  void propose_upright() {
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    const Polygon hull = convex_hull_2d(projected(I));
    if (hull.size() < 3) return;
    const double top = top_height();
    for (const double yaw : yaw_candidates(hull)) propose_upright_box(yaw, top);
    if (best_) {
      const double yaw = std::atan2(best_->R(1, 0), best_->R(0, 0));
      for (const double off_deg : {-4.0, -2.0, -1.0, 1.0, 2.0, 4.0})
        propose_upright_box(yaw + off_deg * M_PI / 180.0, top);
    }
    const Polygon outline = snapped(simplified(hull, tolerance_, options_.max_corners), I);
    propose(prism(I, outline, support_, top), I, ShapeKind::kUprightPrism);
    if (const std::optional<Circle> circle = fit_circle(hull)) {
      propose(prism(I, round_polygon(*circle, options_.circle_sides), support_, top), I, ShapeKind::kUprightCylinder);
    }
  }

  void propose_upright_box(double yaw, double top) {
    const Eigen::Matrix3d R = Eigen::AngleAxisd(yaw, kUp).toRotationMatrix();
    propose(prism(Eigen::Matrix3d::Identity(), footprint_rectangle(yaw, top), support_, top), R,
            ShapeKind::kUprightBox);
  }

  // From the upright faces, and the least rectangle around the footprint.
  std::vector<double> yaw_candidates(const Polygon& hull) const {
    std::vector<double> yaws{least_rectangle_yaw(hull)};
    for (const ObservedFace& face : view_.faces) {
      if (is_upright(face) && is_large(face)) yaws.push_back(std::atan2(face.plane.normal.y(), face.plane.normal.x()));
    }
    return yaws;
  }

  // Bounds by upright faces where they show a side, elsewhere by the points.
  Polygon footprint_rectangle(double yaw, double top) const {
    const Eigen::Vector3d axes[2] = {{std::cos(yaw), std::sin(yaw), 0.0}, {-std::sin(yaw), std::cos(yaw), 0.0}};
    Eigen::Vector2d low, high;
    for (int i = 0; i < 2; ++i) {
      const Range range = robust_range(view_.points, axes[i]);
      low[i] = range.low;
      high[i] = range.high;
      for (const ObservedFace& face : view_.faces) {
        const double along = axes[i].dot(face.plane.normal);
        if (!is_upright(face) || !is_large(face) || std::abs(along) < 0.97) continue;
        const double bound = axes[i].dot(face.centre);
        if (along > 0.0 && std::abs(bound - range.high) < 2.0 * tolerance_) high[i] = bound;
        if (along < 0.0 && std::abs(bound - range.low) < 2.0 * tolerance_) low[i] = bound;
      }
    }
    if (!has_level_face()) deepen(axes, top, low, high);
    return rectangle(yaw, low, high);
  }

  // Without a look at its top an object's depth is unknown: take it as deep as its smaller visible side, away from
  // the camera.
  void deepen(const Eigen::Vector3d axes[2], double top, Eigen::Vector2d& low, Eigen::Vector2d& high) const {
    const Eigen::Vector2d size = high - low;
    const int thin = size.x() < size.y() ? 0 : 1;
    const double wanted = std::min(size[1 - thin], top - support_);
    if (size[thin] >= 0.5 * wanted) return;
    const double camera = axes[thin].dot(evidence_.front().T_world_camera.translation());
    (camera > high[thin] ? low[thin] : high[thin]) += (camera > high[thin] ? -1.0 : 1.0) * (wanted - size[thin]);
  }

  // The outline with its sides moved in to leave a few outliers out, and cut by the faces that are seen edge-on.
  Polygon snapped(const Polygon& outline, const Eigen::Matrix3d& R) const {
    Polygon result = outline;
    for (const HalfPlane& side : half_planes(outline)) {
      const Eigen::Vector3d normal = R * Eigen::Vector3d(side.normal.x(), side.normal.y(), 0.0);
      result = clipped(result, {side.normal, std::min(side.offset, robust_range(view_.points, normal).high)});
    }
    for (const ObservedFace& face : view_.faces) {
      const Eigen::Vector3d local = R.transpose() * face.plane.normal;
      if (!is_large(face) || std::abs(local.z()) > std::sin(options_.upright_deg * M_PI / 180.0)) continue;
      const Eigen::Vector2d normal = local.head<2>().normalized();
      result = clipped(result, {normal, normal.dot((R.transpose() * face.centre).head<2>())});
    }
    return result;
  }

  // Prisms whose ends are upright: along the normal of an upright face, or the edge that two faces share.
  void propose_lying() {
    for (const Eigen::Vector3d& axis : lying_axes()) {
      Eigen::Matrix3d R;
      R << kUp.cross(axis), kUp, axis;
      propose(lying_prism(R), R, ShapeKind::kLyingPrism);
    }
  }

  std::vector<Eigen::Vector3d> lying_axes() const {
    std::vector<Eigen::Vector3d> axes;
    const auto add = [&](Eigen::Vector3d axis) {
      if (axis.norm() < 0.3) return;
      axis.normalize();
      if (std::abs(axis.z()) > std::sin(options_.upright_deg * M_PI / 180.0)) return;
      axis.z() = 0.0;
      axes.push_back(axis.normalized());
    };
    for (std::size_t i = 0; i < view_.faces.size() && i < 6; ++i) {
      if (!is_large(view_.faces[i])) continue;
      if (is_upright(view_.faces[i])) add(view_.faces[i].plane.normal);
      for (std::size_t j = i + 1; j < view_.faces.size() && j < 6; ++j) {
        if (is_large(view_.faces[j])) add(view_.faces[i].plane.normal.cross(view_.faces[j].plane.normal));
      }
    }
    return axes;
  }

  // The profile's sides run on down to the support, but not beyond what is seen by more than a margin.
  std::optional<TriangleMesh> lying_prism(const Eigen::Matrix3d& R) const {
    constexpr double kFacesDown = -0.3;  // of a side's normal
    const Polygon seen = simplified(convex_hull_2d(projected(R)), tolerance_, options_.max_corners);
    if (seen.size() < 3) return std::nullopt;
    const Polygon tight = snapped(seen, R);
    if (tight.size() < 3) return std::nullopt;
    const double margin = std::max(0.0, std::min(view_.lowest - support_, 4.0 * tolerance_));
    double left = std::numeric_limits<double>::infinity(), right = -left, top = support_;
    for (const Eigen::Vector2d& p : tight) {
      left = std::min(left, p.x());
      right = std::max(right, p.x());
      top = std::max(top, p.y());
    }
    Polygon profile{{left - margin, support_}, {right + margin, support_}, {right + margin, top}, {left - margin, top}};
    for (const HalfPlane& side : half_planes(tight)) {
      if (side.normal.y() > kFacesDown && !profile.empty()) profile = clipped(profile, side);
    }
    const Range length = end_faces(R.col(2));
    return prism(R, profile, length.low, length.high);
  }

  Range end_faces(const Eigen::Vector3d& axis) const {
    Range range = robust_range(view_.points, axis);
    for (const ObservedFace& face : view_.faces) {
      const double along = axis.dot(face.plane.normal);
      if (!is_large(face) || std::abs(along) < 0.97) continue;
      const double bound = axis.dot(face.centre);
      if (along > 0.0 && std::abs(bound - range.high) < 2.0 * tolerance_) range.high = bound;
      if (along < 0.0 && std::abs(bound - range.low) < 2.0 * tolerance_) range.low = bound;
    }
    return range;
  }

  // Boxes of two faces at right angles that stand in no simple relation to the table.
  void propose_tilted_boxes() {
    for (std::size_t i = 0; i < view_.faces.size() && i < 4; ++i) {
      for (std::size_t j = i + 1; j < view_.faces.size() && j < 4; ++j) {
        const ObservedFace &a = view_.faces[i], &b = view_.faces[j];
        if (!is_large(a) || !is_large(b) || std::abs(a.plane.normal.dot(b.plane.normal)) > 0.2) continue;
        if ((is_level(a) && is_upright(b)) || (is_level(b) && is_upright(a)) || (is_upright(a) && is_upright(b)))
          continue;
        Eigen::Matrix3d R;
        R.col(0) = a.plane.normal;
        R.col(1) = (b.plane.normal - b.plane.normal.dot(R.col(0)) * R.col(0)).normalized();
        R.col(2) = R.col(0).cross(R.col(1));
        propose(tilted_box(R), R, ShapeKind::kTiltedBox);
      }
    }
  }

  std::optional<TriangleMesh> tilted_box(const Eigen::Matrix3d& R) const {
    Range sides[3];
    double lowest = 0.0;
    int down = 0;
    for (int i = 0; i < 3; ++i) {
      sides[i] = end_faces(R.col(i));
      lowest += std::min(R(2, i) * sides[i].low, R(2, i) * sides[i].high);
      if (std::abs(R(2, i)) > std::abs(R(2, down))) down = i;
    }
    // The axis nearest to the vertical reaches down to the support.
    const double missing = (lowest - support_) / std::abs(R(2, down));
    if (missing > 0.0)
      (R(2, down) > 0.0 ? sides[down].low : sides[down].high) -= (R(2, down) > 0.0 ? 1.0 : -1.0) * missing;
    return prism(R,
                 {{sides[0].low, sides[1].low},
                  {sides[0].high, sides[1].low},
                  {sides[0].high, sides[1].high},
                  {sides[0].low, sides[1].high}},
                 sides[2].low, sides[2].high);
  }

  // The hull of the points and their feet on the support.
  void propose_hull() {
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    const Polygon outline = snapped(simplified(convex_hull_2d(projected(I)), tolerance_, 8), I);
    if (outline.size() < 3) return;
    std::vector<Eigen::Vector3d> feet;
    for (const Eigen::Vector2d& p : outline) feet.emplace_back(p.x(), p.y(), support_);
    std::vector<Eigen::Vector3d> points = view_.points;
    points.insert(points.end(), feet.begin(), feet.end());
    std::optional<TriangleMesh> hull = coarse_hull(points, feet, tolerance_, options_.max_hull_corners);
    for (const ObservedFace& face : view_.faces) {
      if (hull && is_large(face)) hull = cut(*hull, {face.plane.normal, face.plane.normal.dot(face.centre)});
    }
    propose(hull, I, ShapeKind::kHull);
  }

  const ObjectView& view_;
  double support_;
  const ShapeEvidence& evidence_;
  const ShapeFitOptions& options_;
  double tolerance_;  // metres
  std::optional<FittedShape> best_;
};

}  // namespace

std::string to_string(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::kUprightBox:
      return "upright box";
    case ShapeKind::kUprightCylinder:
      return "upright cylinder";
    case ShapeKind::kUprightPrism:
      return "upright prism";
    case ShapeKind::kLyingPrism:
      return "lying prism";
    case ShapeKind::kTiltedBox:
      return "tilted box";
    case ShapeKind::kHull:
      return "hull";
  }
  return "shape";
}

std::optional<FittedShape> fit_shape(const ObjectView& view, double support, const ShapeEvidence& evidence,
                                     const ShapeFitOptions& options) {
  return ShapeFitter(view, support, evidence, options).fit();
}

}  // namespace dofusion
