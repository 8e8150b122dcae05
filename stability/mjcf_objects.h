// Objects from the free bodies of a MuJoCo model. Private to stability.
#pragma once

#include <string>
#include <vector>

#include "stability/mujoco_model.h"
#include "stability/scene.h"

namespace dofusion {

// On a joint, or fixed to something that is.
bool body_moves(const mjModel& model, int body);

struct FreeObject {
  ObjectPtr object;
  int body = 0;                           // the one with the free joint
  Pose T_body_object = Pose::Identity();  // of the body's own frame, not its centre of mass
};

// In the order of the bodies. `data` has the kinematics of any state with the surroundings in place. What becomes of
// what, and what is refused: MjcfScene::to_scene. Throws InputError; `path` names the file in it.
std::vector<FreeObject> free_objects(const mjModel& model, const mjData& data, const std::string& path);

}  // namespace dofusion
