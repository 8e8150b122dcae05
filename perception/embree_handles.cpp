#include "perception/embree_handles.h"

#include <stdexcept>
#include <string>

namespace dofusion {

EmbreeDevice make_embree_device() {
  EmbreeDevice device(rtcNewDevice("threads=1,set_affinity=0"));
  if (!device) throw std::runtime_error("Embree does not start, error " + std::to_string(rtcGetDeviceError(nullptr)));
  return device;
}

EmbreeGeometry make_triangles(RTCDevice device, const TriangleMesh& mesh) {
  EmbreeGeometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), mesh.vertices.size()));
  auto* triangles = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), mesh.triangles.size()));
  check_embree(device);
  for (const Eigen::Vector3d& v : mesh.vertices)
    for (int k = 0; k < 3; ++k) *vertices++ = static_cast<float>(v[k]);
  for (const Eigen::Vector3i& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) *triangles++ = static_cast<unsigned>(t[k]);
  rtcCommitGeometry(geometry.get());
  return geometry;
}

EmbreeScene make_triangle_scene(RTCDevice device, const TriangleMesh& mesh) {
  EmbreeScene scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcAttachGeometry(scene.get(), make_triangles(device, mesh).get());
  rtcCommitScene(scene.get());
  check_embree(device);
  return scene;
}

void check_embree(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_OUT_OF_MEMORY) throw std::runtime_error("Embree: out of memory");
  if (error != RTC_ERROR_NONE) throw std::runtime_error("Embree: error " + std::to_string(error));
}

}  // namespace dofusion
