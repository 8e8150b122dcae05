// MuJoCo XML (MJCF) text for scenes.
#pragma once

#include <string>
#include <vector>

#include "stability/physics.h"
#include "stability/scene.h"

namespace dofusion {

enum class MeshPlacement { kInline, kFiles };

// Free bodies "object_<i>" on a table at z = 0, with the solver settings that the toolkit simulates with. With
// kInline the vertices are in the text; with kFiles meshes are named "<mesh_prefix><i>.obj". `poses` may be empty
// (all at the origin).
std::string mjcf_text(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& poses,
                      const PhysicsOptions& options, MeshPlacement meshes, const std::string& mesh_prefix = "");

}  // namespace dofusion
