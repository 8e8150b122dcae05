// Packets of rays through neighbouring pixels, for Embree. Internal: includes Embree.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <embree3/rtcore.h>

#include "perception/camera.h"
#include "stability/pose.h"

namespace dofusion {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
inline constexpr int kPacket = 16;  // rays, as 4 x 4 neighbouring pixels
inline constexpr int kTile = 4;

// Debian's Embree honours ray masks: a ray with mask 0 hits nothing.
inline constexpr unsigned kHitEverything = 0xFFFFFFFFu;

// The rays of a window of pixels. A ray's direction has length 1 along the optical axis, so that Embree's ray
// parameter is the z-depth itself.
struct PixelGrid {
  PixelGrid(const Camera& camera, const Pose& T_world_camera, int u0_, int v0_, int u1, int v1, int stride_)
      : u0(u0_),
        v0(v0_),
        stride(stride_),
        columns((u1 - u0_ + stride_ - 1) / stride_),
        rows((v1 - v0_ + stride_ - 1) / stride_) {
    const Eigen::Matrix3d R = T_world_camera.linear();
    origin = T_world_camera.translation().cast<float>();
    corner = (R * Eigen::Vector3d((u0 - camera.cx) / camera.fx, (v0 - camera.cy) / camera.fy, 1.0)).cast<float>();
    right = (R.col(0) * (stride / camera.fx)).cast<float>();
    down = (R.col(1) * (stride / camera.fy)).cast<float>();
  }
  Eigen::Vector3f direction(int row, int column) const {
    return corner + static_cast<float>(column) * right + static_cast<float>(row) * down;
  }
  int u0, v0, stride, columns, rows;
  Eigen::Vector3f origin, corner, right, down;
};

// Stands for the table among Embree's geometry ids.
inline constexpr unsigned kTableGeometry = 0xFFFFFFFEu;

// The square |x|, |y| <= half_size of the plane z = 0; none if half_size is negative. Not among Embree's triangles: a
// second kind of geometry in a scene costs a second tree to walk through.
struct Table {
  float half_size = -1.0f;

  // Where the ray origin + t direction meets it, t >= 0; infinity if it does not.
  float distance(float ox, float oy, float oz, float dx, float dy, float dz) const {
    const float t = -oz / dz;
    const bool meets = (t >= 0.0f) & (std::abs(ox + t * dx) <= half_size) & (std::abs(oy + t * dy) <= half_size);
    return meets ? t : kInfinity;  // a ray within the plane has t = NaN or infinity and does not meet it
  }
};

// A packet of the rays through 4 x 4 neighbouring pixels, which moves over the grid.
class TilePacket {
 public:
  TilePacket(const PixelGrid& grid, const Table& table) : grid_(grid), table_(table) {
    rtcInitIntersectContext(&context_);
    context_.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    for (int k = 0; k < kPacket; ++k) {
      const Eigen::Vector3f offset =
          static_cast<float>(k % kTile) * grid.right + static_cast<float>(k / kTile) * grid.down;
      for (int axis = 0; axis < 3; ++axis) offset_[axis][k] = offset[axis];
      packet_.ray.org_x[k] = grid.origin.x();
      packet_.ray.org_y[k] = grid.origin.y();
      packet_.ray.org_z[k] = grid.origin.z();
      packet_.ray.tnear[k] = 0.0f;
      packet_.ray.time[k] = 0.0f;
      packet_.ray.mask[k] = kHitEverything;
      packet_.ray.flags[k] = 0;
    }
  }

  // Casts the rays of the tile whose first pixel is (row0, column0); those beyond the grid are left out.
  void cast(RTCScene world, int row0, int column0) {
    columns_ = std::min(kTile, grid_.columns - column0);
    rows_ = std::min(kTile, grid_.rows - row0);
    const Eigen::Vector3f first = grid_.direction(row0, column0);
    for (int k = 0; k < kPacket; ++k) {
      valid_[k] = k / kTile < rows_ && k % kTile < columns_ ? -1 : 0;
      packet_.ray.dir_x[k] = first.x() + offset_[0][k];
      packet_.ray.dir_y[k] = first.y() + offset_[1][k];
      packet_.ray.dir_z[k] = first.z() + offset_[2][k];
      packet_.ray.tfar[k] = kInfinity;
      packet_.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
      packet_.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
      packet_.hit.primID[k] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(valid_, world, &context_, &packet_);
    lay_table();
  }

  int rows() const { return rows_; }
  int columns() const { return columns_; }

  bool hit(int k) const { return packet_.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID; }
  // RTC_INVALID_GEOMETRY_ID for the table.
  unsigned instance(int k) const { return packet_.hit.instID[0][k]; }
  unsigned triangle(int k) const { return packet_.hit.primID[k]; }
  const float* depths() const { return packet_.ray.tfar; }

  // Sixteen rays that hit the same triangle, or nothing.
  bool uniform() const {
    if (rows_ < kTile || columns_ < kTile) return false;
    unsigned difference = 0;
    for (int k = 0; k < kPacket; ++k)
      difference |=
          (packet_.hit.geomID[k] ^ packet_.hit.geomID[0]) | (instance(k) ^ instance(0)) | (triangle(k) ^ triangle(0));
    return difference == 0;
  }

 private:
  // Puts the table where it is nearer than what was hit. (Not by limiting the rays beforehand: see Scanner::occluded.)
  void lay_table() {
    if (table_.half_size < 0.0f) return;
    const RTCRay16& ray = packet_.ray;
    for (int k = 0; k < kPacket; ++k) {
      const float t =
          table_.distance(ray.org_x[k], ray.org_y[k], ray.org_z[k], ray.dir_x[k], ray.dir_y[k], ray.dir_z[k]);
      const bool nearer = t < ray.tfar[k];
      packet_.ray.tfar[k] = nearer ? t : ray.tfar[k];
      packet_.hit.geomID[k] = nearer ? kTableGeometry : packet_.hit.geomID[k];
      packet_.hit.instID[0][k] = nearer ? RTC_INVALID_GEOMETRY_ID : packet_.hit.instID[0][k];
      packet_.hit.primID[k] = nearer ? RTC_INVALID_GEOMETRY_ID : packet_.hit.primID[k];
    }
  }

  const PixelGrid& grid_;
  Table table_;
  int rows_ = 0, columns_ = 0;  // of the tile within the grid
  RTCIntersectContext context_;
  RTCRayHit16 packet_;
  alignas(64) int valid_[kPacket];
  alignas(64) float offset_[3][kPacket];  // of each ray's direction from the first's
};

}  // namespace dofusion
