// From a noisy estimate of where an object is to the stable pose near it: the reverse process begun at the estimate.
#pragma once

#include <optional>
#include <vector>

#include "apps/pipeline.h"
#include "apps/placement.h"

namespace dofusion {

// Noise scale at which the reverse process begins, in the model's lengths (a cube's edge, augmented_cloud.h) and
// radians alike. Chosen by `refine_study --seed 7301 --sigmas 0.05 0.1 0.2`: more forgets the estimate. Where an object
// stands on a plane, and how it is turned about the vertical, stability cannot tell; that part of the error stays.
inline constexpr double kRefineSigma = 0.05;

// How far two poses are apart: the larger of the distance over the object's diameter / 10 and the angle over
// 10 degrees, the least over the shape's symmetries, so that 1 is what a stable scene may move.
double pose_distance(const Object& object, const std::vector<Eigen::Matrix3d>& symmetries, const Pose& a, const Pose& b);

// Sorts the placements: stable ones first, among them the one that is nearest to all of them (by the median of
// pose_distance) and so on, those that miss a wish after those that miss none; the others behind, by how near they are
// to the estimate. Sets nothing else.
void rank_by_agreement(const Object& query, const Pose& T_world_estimate, std::vector<Placement>& placements);

// The object of the scene that the query at the estimate coincides with: the one that holds the largest part of its
// volume, if that is `least_share` or more; none otherwise.
std::optional<std::size_t> seen_as(const Scene& scene, const Object& query, const Pose& T_world_estimate,
                                   double least_share = 0.35);

// The recovered scene without that object; its pixels become those of nothing.
void remove_object(RecoveredScene& recovered, std::size_t object);

}  // namespace dofusion
