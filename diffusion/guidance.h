// Wishes that steer the reverse process: costs on the query's pose that may be differentiated.
#pragma once

#include <memory>
#include <vector>

#include "diffusion/augmented_cloud.h"
#include "diffusion/se3_noise.h"

namespace dofusion {

// One term of a cost, value^2 / 2, at a pose; `gradient` of the value by a twist in the world frame about the query's
// origin (translation in metres, then rotation vector). Values have no unit: a length over the length that is
// tolerated, so that 1 is one standard deviation.
struct CostTerm {
  double value = 0.0;
  Vector6 gradient = Vector6::Zero();
};

class PoseCost {
 public:
  virtual ~PoseCost() = default;
  // Appends the terms that are not zero.
  virtual void add_terms(const Pose& T_world_query, std::vector<CostTerm>& terms) const = 0;
};

using PoseCostPtr = std::shared_ptr<const PoseCost>;

// Half the sum of the squares of all terms.
double cost_of(const std::vector<PoseCostPtr>& costs, const Pose& T_world_query);

// Half the least of: the costs, linearised, plus the squares of the twist over `position_sigma` (metres) and
// `rotation_sigma` (radians). The pose nearest in that sense, after two steps of Gauss-Newton.
Pose guided(const std::vector<PoseCostPtr>& costs, const Pose& T_world_query, double position_sigma,
            double rotation_sigma);

// Nothing of the query within another object or the table: `points` of each surface, fixed by the seed, against the
// other's signed distance. A depth of `tolerance` metres costs as much as one standard deviation.
PoseCostPtr no_penetration(const Scene& context, const Object& query, double tolerance = 2e-4, int points = 256,
                           std::uint64_t seed = 0);

// The query's origin within a rectangle of the table, world x and y, metres.
PoseCostPtr within_region(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double tolerance = 0.01);

// normal · p >= offset, world, metres; the normal has length 1.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset = 0.0;
};

// The query's origin on the positive side of every plane: above a height, or within what a part of an image shows.
PoseCostPtr within_planes(std::vector<Plane> planes, double tolerance = 0.01);

// The query at least `margin` metres from the objects of `context`, as no_penetration measures it; the table is none.
PoseCostPtr keep_clear(const Scene& context, const Object& query, double margin, double tolerance = 0.002,
                       int points = 256, std::uint64_t seed = 0);

// A direction of the query (own frame, unit) points up, to within `free` radians.
PoseCostPtr upright(const Eigen::Vector3d& axis_query, double free = 0.0, double tolerance = 0.05);

}  // namespace dofusion
