// MuJoCo XML (MJCF) text for scenes.
#pragma once

#include <string>
#include <vector>

#include "stability/physics.h"
#include "stability/scene.h"

namespace dofusion {

// Free bodies "object_<i>" on a table at z = 0, with the solver settings that the toolkit simulates with. `mesh_files`
// names each object's mesh file, relative to the XML (boxes need none); if it is empty, the vertices stand in the text.
// `poses` may be empty (all at the origin).
std::string mjcf_text(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& poses,
                      const PhysicsOptions& options, const std::vector<std::string>& mesh_files = {});

}  // namespace dofusion
