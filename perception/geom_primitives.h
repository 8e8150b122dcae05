// Geoms that have a formula, as geometries of Embree's. Internal: includes Embree.
#pragma once

#include <array>
#include <optional>

#include "perception/embree_handles.h"
#include "perception/geom_rays.h"
#include "stability/geom.h"

namespace dofusion {

// The rays of a packet before they are rounded to float, by ray id, in the world's frame. Whoever casts rays hands this
// to Embree as its context.
struct ExactRays : RTCIntersectContext {
  std::array<Eigen::Vector3d, 16> origin, direction;
};

// A geom in the world, by its formula.
struct Primitive {
  GeomType type = GeomType::kSphere;
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  Eigen::Matrix3d R_geom_world = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();  // the geom's origin

  // In the geom's frame; `along` is the same in both.
  std::optional<RayHit> hit(const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world) const {
    return intersect(type, size, R_geom_world * (origin_world - p_world), R_geom_world * direction_world);
  }
};

// A geometry that intersects ExactRays in double precision (occlusion: Embree's own rays); of a hit, Ng is the unit
// normal in the world's frame. Embree keeps the address of `primitive`: commit the geometry when it has moved. Not for
// planes, which may have no end.
EmbreeGeometry make_primitive(RTCDevice device, Primitive* primitive);

}  // namespace dofusion
