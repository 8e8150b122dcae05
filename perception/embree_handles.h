// Embree's handles as owning pointers. Internal: includes Embree.
#pragma once

#include <memory>
#include <vector>

#include <embree3/rtcore.h>

#include "stability/mesh.h"

namespace dofusion {

struct ReleaseEmbree {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
using EmbreeDevice = std::unique_ptr<RTCDeviceTy, ReleaseEmbree>;
using EmbreeScene = std::unique_ptr<RTCSceneTy, ReleaseEmbree>;
using EmbreeGeometry = std::unique_ptr<RTCGeometryTy, ReleaseEmbree>;

// A device that works on the calling thread alone. Throws std::runtime_error if Embree cannot start.
EmbreeDevice make_embree_device();

// A committed geometry with the mesh's triangles, coordinates rounded to float.
EmbreeGeometry make_triangles(RTCDevice device, const TriangleMesh& mesh);

// A committed scene with that one geometry, whose rays do not slip through between neighbouring triangles.
EmbreeScene make_triangle_scene(RTCDevice device, const TriangleMesh& mesh);

// Throws std::runtime_error if the device has recorded an error, for instance that memory has run out.
void check_embree(RTCDevice device);

}  // namespace dofusion
