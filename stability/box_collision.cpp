#include "stability/box_collision.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <mutex>

namespace dofusion {
namespace {

mjfCollision original_box_box = nullptr;

// How far the point lies outside the box, 0 inside; metres.
mjtNum outside(const mjModel& model, const mjData& data, int geom, const mjtNum* point) {
  mjtNum relative[3], local[3];
  mju_sub3(relative, point, data.geom_xpos + 3 * geom);
  mju_rotVecMatT(local, relative, data.geom_xmat + 9 * geom);
  mjtNum distance = 0.0;
  for (int k = 0; k < 3; ++k) distance = std::max(distance, std::abs(local[k]) - model.geom_size[3 * geom + k]);
  return distance;
}

bool is_face_normal(const mjData& data, int geom, const mjtNum* normal) {
  constexpr mjtNum kParallel = 1.0 - 1e-9;
  mjtNum local[3];
  mju_rotVecMatT(local, normal, data.geom_xmat + 9 * geom);
  return std::any_of(local, local + 3, [](mjtNum cosine) { return std::abs(cosine) > kParallel; });
}

int box_box(const mjModel* model, const mjData* data, mjContact* contacts, int geom1, int geom2, mjtNum margin) {
  constexpr mjtNum kTolerance = 1e-6;  // metres; true contacts lie within both boxes to rounding
  const int found = original_box_box(model, data, contacts, geom1, geom2, margin);
  int kept = 0;
  for (int i = 0; i < found; ++i) {
    mjContact contact = contacts[i];
    if (is_face_normal(*data, geom1, contact.frame) || is_face_normal(*data, geom2, contact.frame)) contact.dist *= 2.0;
    const mjtNum allowed = kTolerance + std::max<mjtNum>(contact.dist, 0.0);
    if (contact.dist > margin || outside(*model, *data, geom1, contact.pos) > allowed ||
        outside(*model, *data, geom2, contact.pos) > allowed) {
      continue;
    }
    contacts[kept++] = contact;
  }
  if (found == 0 || kept > 0) return kept;
  return mjCOLLISIONFUNC[mjGEOM_CYLINDER][mjGEOM_BOX](model, data, contacts, geom1, geom2, margin);
}

}  // namespace

void repair_box_collision() {
  static std::once_flag once;
  std::call_once(once, [] {
    original_box_box = mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX];
    mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX] = box_box;
  });
}

}  // namespace dofusion
