#include "perception/contact_costs.h"

#include <algorithm>
#include <cmath>

namespace dofusion {
namespace {

double squared(double x) { return x * x; }

}  // namespace

double penetration_cost(const std::vector<ObjectModel>& models, const PlacedObject& object,
                        const std::vector<PlacedObject>& others, double sigma) {
  const ObjectModel& model = models[object.model];
  double cost = 0.5 * squared(std::min(0.0, lowest_point(model, object.T_world_object)) / sigma);
  for (const PlacedObject& other : others) {
    cost += 0.5 * squared(overlap(model, object.T_world_object, models[other.model], other.T_world_object) / sigma);
  }
  return cost;
}

double floating_cost(const std::vector<ObjectModel>& models, const PlacedObject& object,
                     const std::vector<PlacedObject>& others, double sigma) {
  double gap = lowest_point(models[object.model], object.T_world_object);
  for (const PlacedObject& other : others) {
    if (gap <= 0.0) return 0.0;
    gap = std::min(gap,
                   clearance(models[object.model], object.T_world_object, models[other.model], other.T_world_object));
  }
  return std::min(300.0, 0.5 * squared(std::max(0.0, gap) / sigma));
}

std::vector<double> support_heights(const std::vector<ObjectModel>& models, const std::vector<PlacedObject>& objects) {
  std::vector<double> heights = {0.0};
  for (const PlacedObject& object : objects) {
    for (const PlanarFace& face : models[object.model].faces) {
      if ((object.T_world_object.linear() * face.normal).z() > 0.9995) {
        heights.push_back((object.T_world_object * face.centroid).z());
      }
    }
  }
  return heights;
}

std::optional<Pose> laid_flat(const ObjectModel& model, const Pose& pose, const std::vector<double>& heights) {
  constexpr double kTilt = 0.07, kGap = 0.004;  // radians, metres
  const double lowest = lowest_point(model, pose);
  for (const DistinctRest& rest : model.resting) {
    for (const Eigen::Matrix3d& symmetry : model.symmetries) {
      // The direction in the object's frame that points down when it rests so.
      const Eigen::Vector3d down = symmetry * (rest.pose.R_world_object.transpose() * -Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d down_world = pose.linear() * down;
      if (down_world.z() > -std::cos(kTilt)) continue;
      for (const double height : heights) {
        if (std::abs(lowest - height) > kGap) continue;
        const Eigen::Matrix3d upright =
            Eigen::Quaterniond::FromTwoVectors(down_world, -Eigen::Vector3d::UnitZ()).toRotationMatrix();
        Eigen::Vector3d t = pose.translation();
        t.z() = height + rest.pose.height;
        return make_pose(upright * pose.linear(), t);
      }
    }
  }
  return std::nullopt;
}

}  // namespace dofusion
