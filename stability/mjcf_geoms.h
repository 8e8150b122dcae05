// Geoms and cameras of a MuJoCo model as plain data. Private to stability.
#pragma once

#include <string>
#include <vector>

#include "stability/geom.h"
#include "stability/mujoco_model.h"

namespace dofusion {

// All geoms of the model, in its order. `ids`: the model's bodies that have geoms; Geom::body is an index into it.
// Throws InputError naming the file `path` if a geom's numbers make no sense.
std::vector<Geom> model_geoms(const mjModel& model, const std::vector<int>& ids, const std::string& path);

// All cameras, in the model's order, as in `data`, where they are placed. Throws as model_geoms.
std::vector<SceneCamera> model_cameras(const mjModel& model, const mjData& data, const std::vector<int>& ids,
                                       const std::string& path);

// Position of the body's centre of mass, orientation of its frame.
Pose centre_pose(const mjData& data, int body);

}  // namespace dofusion
