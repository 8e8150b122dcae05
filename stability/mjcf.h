// MuJoCo XML (MJCF) text for scenes.
#pragma once

#include <string>
#include <vector>

#include "stability/physics.h"
#include "stability/scene.h"

namespace dofusion {

struct MjcfOptions {
  std::vector<std::string> mesh_files;  // each object's, relative to the XML; empty: the vertices stand in the text
  std::vector<bool> fixed;              // objects without a joint (MuJoCo's mocap bodies); empty: none
};

// Bodies "object_<i>" with free joints on a table at z = 0, with the solver settings that the toolkit simulates with.
// Mass and inertia are the exact solid's; boxes, cylinders and spheres are MuJoCo's own, other objects are meshes, in
// convex parts where they are not convex. `poses` may be empty (all at the origin).
std::string mjcf_text(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& poses,
                      const PhysicsOptions& options, const MjcfOptions& mjcf = {});

// Writes `directory`/scene.xml and `directory`/objects/<i>.obj, which MuJoCo's `simulate` opens as they are. Throws
// InputError naming the directory if it cannot be written.
void write_mjcf(const Scene& scene, const std::string& directory, const PhysicsOptions& options = {});

}  // namespace dofusion
