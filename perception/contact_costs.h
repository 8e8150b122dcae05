// What is physically wrong with objects at their poses, and what they can stand on.
#pragma once

#include <optional>
#include <vector>

#include "perception/object_model.h"
#include "perception/pose_refinement.h"

namespace dofusion {

struct PlacedObject {
  int model = 0;  // index into the models
  Pose T_world_object = Pose::Identity();
  Freedom freedom = Freedom::kFree;
};

// Overlap of an object with the others and with the table, in nats: half the squared depth over `sigma` (metres).
double penetration_cost(const std::vector<ObjectModel>& models, const PlacedObject& object,
                        const std::vector<PlacedObject>& others, double sigma);

// Likewise for the gap between an object and the nearest thing that could hold it; at most 300.
double floating_cost(const std::vector<ObjectModel>& models, const PlacedObject& object,
                     const std::vector<PlacedObject>& others, double sigma);

// Level surfaces to rest on, metres: the table and the flat tops of objects.
std::vector<double> support_heights(const std::vector<ObjectModel>& models, const std::vector<PlacedObject>& objects);

// The pose laid flat, if it lies nearly flat (4 degrees, 4 mm) on one of the level surfaces.
std::optional<Pose> laid_flat(const ObjectModel& model, const Pose& pose, const std::vector<double>& heights);

}  // namespace dofusion
