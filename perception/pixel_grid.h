// The rays of an image's pixels, cast in packets of neighbours. Internal: includes Embree.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include <embree3/rtcore.h>

#include "perception/camera.h"
#include "perception/scanner.h"
#include "stability/parallel_for.h"
#include "stability/pose.h"

namespace dofusion {

inline constexpr int kPacket = 16;  // rays, as 4 x 4 neighbouring pixels
inline constexpr int kTile = 4;

// Debian's Embree honours ray masks: a ray with mask 0 hits nothing.
inline constexpr unsigned kHitEverything = 0xFFFFFFFFu;
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

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
    exact_origin = T_world_camera.translation();
    exact_corner = R * Eigen::Vector3d((u0 - camera.cx) / camera.fx, (v0 - camera.cy) / camera.fy, 1.0);
    exact_right = R.col(0) * (stride / camera.fx);
    exact_down = R.col(1) * (stride / camera.fy);
    origin = exact_origin.cast<float>();
    corner = exact_corner.cast<float>();
    right = exact_right.cast<float>();
    down = exact_down.cast<float>();
  }
  Eigen::Vector3f direction(int row, int column) const {
    return corner + static_cast<float>(column) * right + static_cast<float>(row) * down;
  }
  Eigen::Vector3d exact_direction(int row, int column) const {
    return exact_corner + column * exact_right + row * exact_down;
  }
  int u0, v0, stride, columns, rows;
  Eigen::Vector3f origin, corner, right, down;
  Eigen::Vector3d exact_origin, exact_corner, exact_right, exact_down;
};

// What all packets of a window have in common.
inline void start_packet(const PixelGrid& grid, RTCRayHit16& packet) {
  for (int k = 0; k < kPacket; ++k) {
    packet.ray.org_x[k] = grid.origin.x();
    packet.ray.org_y[k] = grid.origin.y();
    packet.ray.org_z[k] = grid.origin.z();
    packet.ray.tnear[k] = 0.0f;
    packet.ray.time[k] = 0.0f;
    packet.ray.mask[k] = kHitEverything;
    packet.ray.id[k] = static_cast<unsigned>(k);
    packet.ray.flags[k] = 0;
  }
}

// The 4 x 4 rays of the tile whose first pixel is (row0, column0); rays beyond the window are marked invalid.
inline void fill_packet(const PixelGrid& grid, int row0, int column0, RTCRayHit16& packet, int* valid) {
  const Eigen::Vector3f d = grid.direction(row0, column0);
  for (int k = 0; k < kPacket; ++k) {
    const int row = k / kTile, column = k % kTile;
    const float r = static_cast<float>(row), c = static_cast<float>(column);
    valid[k] = row0 + row < grid.rows && column0 + column < grid.columns ? -1 : 0;
    packet.ray.dir_x[k] = d.x() + c * grid.right.x() + r * grid.down.x();
    packet.ray.dir_y[k] = d.y() + c * grid.right.y() + r * grid.down.y();
    packet.ray.dir_z[k] = d.z() + c * grid.right.z() + r * grid.down.z();
    packet.ray.tfar[k] = kInfinity;
    packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
  }
}

// Calls trace(row0, column0, packet, valid) for every tile of the grid, with its rays ready to be cast, on `threads`
// threads; what it does for a tile may hang on nothing but the tile.
template <class Trace>
void for_each_tile(const PixelGrid& grid, int threads, const Trace& trace) {
  constexpr int kBand = 4;  // rows of tiles that a thread takes at a time
  const int tile_rows = (grid.rows + kTile - 1) / kTile;
  parallel_for((tile_rows + kBand - 1) / kBand, threads, [&](std::int64_t band, int) {
    RTCRayHit16 packet;
    alignas(64) int valid[kPacket];
    start_packet(grid, packet);
    const int first = static_cast<int>(band) * kBand * kTile;
    const int end = std::min(first + kBand * kTile, grid.rows);
    for (int row0 = first; row0 < end; row0 += kTile) {
      for (int column0 = 0; column0 < grid.columns; column0 += kTile) {
        fill_packet(grid, row0, column0, packet, valid);
        trace(row0, column0, packet, valid);
      }
    }
  });
}

// Throws std::invalid_argument unless it has a positive size and focal length.
void check_camera(const Camera& camera);

// For each segment 1 if something of the committed scene lies on it, else 0.
std::vector<std::uint8_t> occluded_segments(RTCScene world, const std::vector<Scanner::Segment>& segments);

}  // namespace dofusion
