#include "diffusion/guidance.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Dense>

namespace dofusion {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Points apart in x, y and z, as CloudShape takes them.
struct Points {
  explicit Points(int count) : values(static_cast<std::size_t>(3 * count)), n(count) {}
  Columns columns() { return {values.data(), values.data() + n, values.data() + 2 * n}; }
  ConstColumns columns() const { return {values.data(), values.data() + n, values.data() + 2 * n}; }
  Vector3d operator[](int i) const { return {values[i], values[n + i], values[2 * n + i]}; }
  std::vector<float> values;
  int n;
};

Points sampled(const CloudShape& shape, int count, Rng& rng) {
  Points points(count), normals(count);
  shape.sample(count, 0.0, rng, points.columns(), normals.columns());
  return points;
}

Points transformed(const Points& points, const Pose& T) {
  Points out(points.n);
  for (int i = 0; i < points.n; ++i) {
    const Vector3d p = T * points[i];
    for (int d = 0; d < 3; ++d) out.columns()[d][i] = static_cast<float>(p[d]);
  }
  return out;
}

// What no_penetration and keep_clear have in common: surfaces at least `margin` apart.
class Apart : public PoseCost {
 public:
  Apart(const Scene& context, const Object& query, double margin, bool table, double tolerance, int points,
        std::uint64_t seed)
      : query_(query), query_points_(0), margin_(margin), table_(table), tolerance_(tolerance) {
    Rng rng = make_rng(seed, 0x67756964u);
    query_points_ = sampled(query_, points, rng);
    for (std::size_t i = 0; i < context.objects.size(); ++i) {
      shapes_.emplace_back(*context.objects[i]);
      poses_.push_back(context.T_world_object[i]);
      context_points_.push_back(sampled(shapes_.back(), points, rng));
    }
  }

  void add_terms(const Pose& T_world_query, std::vector<CostTerm>& terms) const override {
    const Vector3d origin = T_world_query.translation();
    const Points world = transformed(query_points_, T_world_query);
    if (table_) {
      for (int i = 0; i < world.n; ++i) add(-world[i].z(), Vector3d::UnitZ(), world[i] - origin, terms);
    }
    std::vector<float> distance(static_cast<std::size_t>(world.n));
    Points direction(world.n);
    for (std::size_t k = 0; k < shapes_.size(); ++k) {
      // The query's points in the other object, which they must leave along its distance …
      const Points in_other = transformed(query_points_, poses_[k].inverse() * T_world_query);
      shapes_[k].signed_distance(world.n, in_other.columns(), distance.data(), direction.columns());
      for (int i = 0; i < world.n; ++i) add(margin_ - distance[i], poses_[k].linear() * direction[i], world[i] - origin, terms);
      // … and the other's points in the query, which must be left behind.
      const Points in_query = transformed(context_points_[k], T_world_query.inverse() * poses_[k]);
      query_.signed_distance(world.n, in_query.columns(), distance.data(), direction.columns());
      for (int i = 0; i < world.n; ++i)
        add(margin_ - distance[i], -(T_world_query.linear() * direction[i]), T_world_query.linear() * in_query[i], terms);
    }
  }

 private:
  // A point at `arm` from the query's origin that is `depth` too deep and comes free along `out`.
  void add(double depth, const Vector3d& out, const Vector3d& arm, std::vector<CostTerm>& terms) const {
    if (depth <= 0.0) return;
    CostTerm term;
    term.value = depth / tolerance_;
    term.gradient << -out / tolerance_, -arm.cross(out) / tolerance_;
    terms.push_back(term);
  }

  CloudShape query_;
  Points query_points_;
  double margin_;
  bool table_;
  double tolerance_;
  std::vector<CloudShape> shapes_;
  std::vector<Pose> poses_;
  std::vector<Points> context_points_;
};

class WithinRegion : public PoseCost {
 public:
  WithinRegion(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double tolerance)
      : low_(low), high_(high), tolerance_(tolerance) {}

  void add_terms(const Pose& T_world_query, std::vector<CostTerm>& terms) const override {
    for (int d = 0; d < 2; ++d) {
      const double at = T_world_query.translation()[d], beyond = at - std::clamp(at, low_[d], high_[d]);
      if (beyond == 0.0) continue;
      CostTerm term;
      term.value = beyond / tolerance_;
      term.gradient[d] = 1.0 / tolerance_;
      terms.push_back(term);
    }
  }

 private:
  Eigen::Vector2d low_, high_;
  double tolerance_;
};

class WithinPlanes : public PoseCost {
 public:
  WithinPlanes(std::vector<Plane> planes, double tolerance) : planes_(std::move(planes)), tolerance_(tolerance) {}

  void add_terms(const Pose& T_world_query, std::vector<CostTerm>& terms) const override {
    for (const Plane& plane : planes_) {
      const double short_of = plane.offset - plane.normal.dot(T_world_query.translation());
      if (short_of <= 0.0) continue;
      CostTerm term;
      term.value = short_of / tolerance_;
      term.gradient.head<3>() = -plane.normal / tolerance_;
      terms.push_back(term);
    }
  }

 private:
  std::vector<Plane> planes_;
  double tolerance_;
};

class Upright : public PoseCost {
 public:
  Upright(const Vector3d& axis, double free, double tolerance) : axis_(axis), free_(free), tolerance_(tolerance) {}

  void add_terms(const Pose& T_world_query, std::vector<CostTerm>& terms) const override {
    const Vector3d axis = T_world_query.linear() * axis_;
    Vector3d turn = axis.cross(Vector3d::UnitZ());  // rotating about it raises the axis
    const double angle = std::atan2(turn.norm(), axis.z());
    if (angle <= free_) return;
    turn = turn.norm() > 1e-9 ? turn.normalized() : axis.unitOrthogonal();
    CostTerm term;
    term.value = (angle - free_) / tolerance_;
    term.gradient.tail<3>() = -turn / tolerance_;
    terms.push_back(term);
  }

 private:
  Vector3d axis_;
  double free_, tolerance_;
};

}  // namespace

double cost_of(const std::vector<PoseCostPtr>& costs, const Pose& T_world_query) {
  std::vector<CostTerm> terms;
  for (const PoseCostPtr& cost : costs) cost->add_terms(T_world_query, terms);
  double sum = 0.0;
  for (const CostTerm& term : terms) sum += 0.5 * term.value * term.value;
  return sum;
}

Pose guided(const std::vector<PoseCostPtr>& costs, const Pose& T_world_query, double position_sigma,
            double rotation_sigma) {
  constexpr int kSteps = 2;
  Vector6 precision;  // of the belief in the given pose
  precision.head<3>().setConstant(1.0 / (position_sigma * position_sigma));
  precision.tail<3>().setConstant(1.0 / (rotation_sigma * rotation_sigma));
  Pose pose = T_world_query;
  Vector6 moved = Vector6::Zero();  // from the given pose
  std::vector<CostTerm> terms;
  for (int step = 0; step < kSteps; ++step) {
    terms.clear();
    for (const PoseCostPtr& cost : costs) cost->add_terms(pose, terms);
    if (terms.empty()) break;
    Eigen::Matrix<double, 6, 6> A = precision.asDiagonal();
    Vector6 b = -precision.cwiseProduct(moved);
    for (const CostTerm& term : terms) {
      A += term.gradient * term.gradient.transpose();
      b -= term.value * term.gradient;
    }
    const Vector6 twist = A.ldlt().solve(b);
    pose = add_world_noise(pose, twist);
    moved += twist;
  }
  return pose;
}

PoseCostPtr no_penetration(const Scene& context, const Object& query, double tolerance, int points,
                           std::uint64_t seed) {
  if (!(tolerance > 0.0) || points < 1)
    throw std::invalid_argument("no_penetration needs a positive tolerance and at least one point");
  return std::make_shared<Apart>(context, query, 0.0, true, tolerance, points, seed);
}

PoseCostPtr keep_clear(const Scene& context, const Object& query, double margin, double tolerance, int points,
                       std::uint64_t seed) {
  if (!(margin >= 0.0) || !(tolerance > 0.0) || points < 1)
    throw std::invalid_argument("keep_clear needs a margin of at least 0, a positive tolerance and at least one point");
  return std::make_shared<Apart>(context, query, margin, false, tolerance, points, seed);
}

PoseCostPtr within_planes(std::vector<Plane> planes, double tolerance) {
  for (const Plane& plane : planes) {
    if (!(std::abs(plane.normal.norm() - 1.0) < 1e-6) || !std::isfinite(plane.offset))
      throw std::invalid_argument("within_planes needs normals of length 1 and finite offsets");
  }
  if (!(tolerance > 0.0)) throw std::invalid_argument("within_planes needs a positive tolerance");
  return std::make_shared<WithinPlanes>(std::move(planes), tolerance);
}

PoseCostPtr within_region(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double tolerance) {
  if (!(low.x() <= high.x()) || !(low.y() <= high.y()) || !(tolerance > 0.0))
    throw std::invalid_argument("a region needs low <= high and a positive tolerance");
  return std::make_shared<WithinRegion>(low, high, tolerance);
}

PoseCostPtr upright(const Eigen::Vector3d& axis_query, double free, double tolerance) {
  if (!(axis_query.norm() > 0.0) || !(free >= 0.0) || !(tolerance > 0.0))
    throw std::invalid_argument("upright needs an axis, an angle of at least 0 and a positive tolerance");
  return std::make_shared<Upright>(axis_query.normalized(), free, tolerance);
}

}  // namespace dofusion
