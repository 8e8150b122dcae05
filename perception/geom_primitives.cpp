#include "perception/geom_primitives.h"

#include <limits>

namespace dofusion {
namespace {

using Eigen::Vector3d;

// Half the edges of the box around the geom in its own frame.
Vector3d half_extent(GeomType type, const Vector3d& size) {
  switch (type) {
    case GeomType::kSphere:
      return Vector3d::Constant(size.x());
    case GeomType::kCapsule:
      return {size.x(), size.x(), size.x() + size.y()};
    case GeomType::kCylinder:
      return {size.x(), size.x(), size.y()};
    default:
      return size;
  }
}

void bound(const RTCBoundsFunctionArguments* arguments) {
  const auto& primitive = *static_cast<const Primitive*>(arguments->geometryUserPtr);
  const Vector3d half = primitive.R_geom_world.transpose().cwiseAbs() * half_extent(primitive.type, primitive.size);
  // Rays reach us rounded to float: a little larger.
  const Vector3d slack = 1e-5 * (half + primitive.p_world.cwiseAbs());
  const Vector3d low = primitive.p_world - half - slack, high = primitive.p_world + half + slack;
  RTCBounds& bounds = *arguments->bounds_o;
  bounds.lower_x = static_cast<float>(low.x());
  bounds.lower_y = static_cast<float>(low.y());
  bounds.lower_z = static_cast<float>(low.z());
  bounds.upper_x = static_cast<float>(high.x());
  bounds.upper_y = static_cast<float>(high.y());
  bounds.upper_z = static_cast<float>(high.z());
}

void intersect_packet(const RTCIntersectFunctionNArguments* arguments) {
  const auto& primitive = *static_cast<const Primitive*>(arguments->geometryUserPtr);
  const auto& rays = *static_cast<const ExactRays*>(arguments->context);
  RTCRayN* ray = RTCRayHitN_RayN(arguments->rayhit, arguments->N);
  RTCHitN* hit = RTCRayHitN_HitN(arguments->rayhit, arguments->N);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] == 0) continue;
    const unsigned id = RTCRayN_id(ray, arguments->N, i);
    const auto found = primitive.hit(rays.origin[id], rays.direction[id]);
    if (!found || !(static_cast<float>(found->along) < RTCRayN_tfar(ray, arguments->N, i))) continue;
    RTCRayN_tfar(ray, arguments->N, i) = static_cast<float>(found->along);
    const Eigen::Vector3f normal = (primitive.R_geom_world.transpose() * found->normal).cast<float>();
    RTCHitN_Ng_x(hit, arguments->N, i) = normal.x();
    RTCHitN_Ng_y(hit, arguments->N, i) = normal.y();
    RTCHitN_Ng_z(hit, arguments->N, i) = normal.z();
    RTCHitN_geomID(hit, arguments->N, i) = arguments->geomID;
    RTCHitN_primID(hit, arguments->N, i) = 0;
    RTCHitN_instID(hit, arguments->N, i, 0) = RTC_INVALID_GEOMETRY_ID;
  }
}

void occlude_packet(const RTCOccludedFunctionNArguments* arguments) {
  const auto& primitive = *static_cast<const Primitive*>(arguments->geometryUserPtr);
  RTCRayN* ray = arguments->ray;
  const unsigned n = arguments->N;
  for (unsigned i = 0; i < n; ++i) {
    if (arguments->valid[i] == 0) continue;
    const Vector3d origin(RTCRayN_org_x(ray, n, i), RTCRayN_org_y(ray, n, i), RTCRayN_org_z(ray, n, i));
    const Vector3d direction(RTCRayN_dir_x(ray, n, i), RTCRayN_dir_y(ray, n, i), RTCRayN_dir_z(ray, n, i));
    const auto found = primitive.hit(origin, direction);
    if (found && found->along <= RTCRayN_tfar(ray, n, i))
      RTCRayN_tfar(ray, n, i) = -std::numeric_limits<float>::infinity();
  }
}

}  // namespace

EmbreeGeometry make_primitive(RTCDevice device, Primitive* primitive) {
  EmbreeGeometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER));
  rtcSetGeometryUserPrimitiveCount(geometry.get(), 1);
  rtcSetGeometryUserData(geometry.get(), primitive);
  rtcSetGeometryBoundsFunction(geometry.get(), bound, nullptr);
  rtcSetGeometryIntersectFunction(geometry.get(), intersect_packet);
  rtcSetGeometryOccludedFunction(geometry.get(), occlude_packet);
  return geometry;
}

}  // namespace dofusion
