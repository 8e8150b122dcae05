#include "perception/scanner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "perception/embree_handles.h"

namespace dofusion {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kPacket = 16;  // rays, as 4 x 4 neighbouring pixels
constexpr int kTile = 4;
constexpr int kMaxObjects = 255 - kLabelFirstObject;

// Debian's Embree honours ray masks: a ray with mask 0 hits nothing.
constexpr unsigned kHitEverything = 0xFFFFFFFFu;

TriangleMesh table_mesh(double half_size) {
  const double h = half_size;
  return {{{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}}, {{0, 1, 2}, {0, 2, 3}}};
}

std::vector<Eigen::Vector3d> triangle_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals;
  normals.reserve(mesh.triangles.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    normals.push_back((mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).stableNormalized());
  }
  return normals;
}

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

// What all packets of a window have in common.
void start_packet(const PixelGrid& grid, RTCRayHit16& packet) {
  for (int k = 0; k < kPacket; ++k) {
    packet.ray.org_x[k] = grid.origin.x();
    packet.ray.org_y[k] = grid.origin.y();
    packet.ray.org_z[k] = grid.origin.z();
    packet.ray.tnear[k] = 0.0f;
    packet.ray.time[k] = 0.0f;
    packet.ray.mask[k] = kHitEverything;
    packet.ray.flags[k] = 0;
  }
}

// The 4 x 4 rays of the tile whose first pixel is (row0, column0); rays beyond the window are marked invalid.
void fill_packet(const PixelGrid& grid, int row0, int column0, RTCRayHit16& packet, int* valid) {
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

}  // namespace

struct Scanner::Impl {
  EmbreeDevice device;
  std::vector<ObjectPtr> objects;
  std::vector<EmbreeScene> object_scenes;             // per object
  std::vector<EmbreeGeometry> instances;              // per object, geometry id i of the world
  std::vector<std::vector<Eigen::Vector3d>> normals;  // per object and triangle, in the object's frame
  std::vector<Eigen::Matrix3d> R_world_object;        // per object
  EmbreeGeometry table;                               // geometry id objects.size() of the world
  EmbreeScene world;
  bool changed = true;  // since the world was last committed

  void commit() {
    if (!changed) return;
    rtcCommitScene(world.get());
    check_embree(device.get());
    changed = false;
  }

  // Embree's geometry ids: an object's hit carries its instance, the table's none.
  int object_of(unsigned instance) const {
    return instance == RTC_INVALID_GEOMETRY_ID ? -1 : static_cast<int>(instance);
  }
  Eigen::Vector3d normal_world(int object, unsigned triangle) const {
    if (object < 0) return Eigen::Vector3d::UnitZ();
    return R_world_object[object] * normals[object][triangle];
  }
};

Scanner::Scanner(std::vector<ObjectPtr> objects, const ScannerOptions& options) : impl_(std::make_unique<Impl>()) {
  if (objects.size() > kMaxObjects)
    throw std::invalid_argument("a scanner labels at most " + std::to_string(kMaxObjects) + " objects, not " +
                                std::to_string(objects.size()));
  if (!(options.table_half_size > 0.0))
    throw std::invalid_argument("table_half_size must be positive, not " + std::to_string(options.table_half_size));
  Impl& impl = *impl_;
  impl.objects = std::move(objects);
  impl.device = make_embree_device();
  impl.world.reset(rtcNewScene(impl.device.get()));
  rtcSetSceneFlags(impl.world.get(), static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC));
  for (std::size_t i = 0; i < impl.objects.size(); ++i) {
    const TriangleMesh& mesh = impl.objects[i]->mesh;
    // Equal objects share one tree.
    const auto same =
        std::find(impl.objects.begin(), impl.objects.begin() + static_cast<std::ptrdiff_t>(i), impl.objects[i]) -
        impl.objects.begin();
    if (static_cast<std::size_t>(same) < i) {
      rtcRetainScene(impl.object_scenes[same].get());
      impl.object_scenes.emplace_back(impl.object_scenes[same].get());
    } else {
      impl.object_scenes.push_back(make_triangle_scene(impl.device.get(), mesh));
    }
    impl.normals.push_back(triangle_normals(mesh));
    impl.instances.emplace_back(rtcNewGeometry(impl.device.get(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(impl.instances.back().get(), impl.object_scenes.back().get());
    rtcSetGeometryTimeStepCount(impl.instances.back().get(), 1);
    rtcAttachGeometryByID(impl.world.get(), impl.instances.back().get(), static_cast<unsigned>(i));
  }
  if (options.table) {
    impl.table = make_triangles(impl.device.get(), table_mesh(options.table_half_size));
    rtcAttachGeometryByID(impl.world.get(), impl.table.get(), static_cast<unsigned>(impl.objects.size()));
  }
  set_poses(std::vector<Pose>(impl.objects.size(), Pose::Identity()));
}

Scanner::~Scanner() = default;
Scanner::Scanner(Scanner&&) noexcept = default;
Scanner& Scanner::operator=(Scanner&&) noexcept = default;

void Scanner::set_poses(const std::vector<Pose>& T_world_object) {
  Impl& impl = *impl_;
  if (T_world_object.size() != impl.objects.size())
    throw std::invalid_argument("a scanner of " + std::to_string(impl.objects.size()) + " objects was given " +
                                std::to_string(T_world_object.size()) + " poses");
  impl.R_world_object.resize(T_world_object.size());
  for (std::size_t i = 0; i < T_world_object.size(); ++i) {
    const Eigen::Matrix<float, 3, 4> T = T_world_object[i].matrix().topRows<3>().cast<float>();
    rtcSetGeometryTransform(impl.instances[i].get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, T.data());
    rtcCommitGeometry(impl.instances[i].get());
    impl.R_world_object[i] = T_world_object[i].linear();
  }
  impl.changed = true;
}

void Scanner::set_visible(int object, bool visible) {
  if (object < 0 || object >= static_cast<int>(impl_->objects.size()))
    throw std::invalid_argument("there is no object " + std::to_string(object));
  RTCGeometry instance = impl_->instances[object].get();
  if (visible)
    rtcEnableGeometry(instance);
  else
    rtcDisableGeometry(instance);
  impl_->changed = true;
}

namespace {

void check_camera(const Camera& camera) {
  if (camera.width <= 0 || camera.height <= 0 || !(camera.fx > 0.0) || !(camera.fy > 0.0))
    throw std::invalid_argument("a camera needs a positive size and focal length, not " + std::to_string(camera.width) +
                                "x" + std::to_string(camera.height) + ", fx " + std::to_string(camera.fx) + ", fy " +
                                std::to_string(camera.fy));
}

}  // namespace

// Casts the grid's rays in packets and hands each hit to found(pixel, depth, instance, triangle).
template <class Found>
void cast_grid(RTCScene world, const PixelGrid& grid, const Found& found) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  RTCRayHit16 packet;
  alignas(64) int valid[kPacket];
  start_packet(grid, packet);
  for (int row0 = 0; row0 < grid.rows; row0 += kTile)
    for (int column0 = 0; column0 < grid.columns; column0 += kTile) {
      fill_packet(grid, row0, column0, packet, valid);
      rtcIntersect16(valid, world, &context, &packet);
      for (int k = 0; k < kPacket; ++k)
        if (valid[k] && packet.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID)
          found(static_cast<std::size_t>(row0 + k / kTile) * grid.columns + column0 + k % kTile, packet.ray.tfar[k],
                packet.hit.instID[0][k], packet.hit.primID[k]);
    }
}

Scan Scanner::render(const Camera& camera, const Pose& T_world_camera) const {
  check_camera(camera);
  Impl& impl = *impl_;
  impl.commit();
  Scan scan{DepthImage(camera.width, camera.height), LabelImage(camera.width, camera.height),
            NormalImage(camera.width, camera.height, Eigen::Vector3f::Zero())};
  const PixelGrid grid(camera, T_world_camera, 0, 0, camera.width, camera.height, 1);
  const Eigen::Matrix3d R_camera_world = T_world_camera.linear().transpose();
  cast_grid(impl.world.get(), grid, [&](std::size_t pixel, float depth, unsigned instance, unsigned triangle) {
    const int object = impl.object_of(instance);
    scan.depth.pixels[pixel] = depth;
    scan.labels.pixels[pixel] = object < 0 ? kLabelTable : static_cast<std::uint8_t>(kLabelFirstObject + object);
    scan.normals.pixels[pixel] = (R_camera_world * impl.normal_world(object, triangle)).cast<float>();
  });
  return scan;
}

Scan Scanner::render_window(const Camera& camera, const Pose& T_world_camera, int u0, int v0, int u1, int v1,
                            int stride) const {
  check_camera(camera);
  if (u1 <= u0 || v1 <= v0 || stride <= 0)
    throw std::invalid_argument("the window [" + std::to_string(u0) + ", " + std::to_string(u1) + ") x [" +
                                std::to_string(v0) + ", " + std::to_string(v1) + ") with stride " +
                                std::to_string(stride) + " has no pixels");
  Impl& impl = *impl_;
  impl.commit();
  const PixelGrid grid(camera, T_world_camera, u0, v0, u1, v1, stride);
  Scan scan{DepthImage(grid.columns, grid.rows), LabelImage(grid.columns, grid.rows), NormalImage()};
  cast_grid(impl.world.get(), grid, [&](std::size_t pixel, float depth, unsigned instance, unsigned) {
    const int object = impl.object_of(instance);
    scan.depth.pixels[pixel] = depth;
    scan.labels.pixels[pixel] = object < 0 ? kLabelTable : static_cast<std::uint8_t>(kLabelFirstObject + object);
  });
  return scan;
}

std::optional<Scanner::Hit> Scanner::cast_ray(const Eigen::Vector3d& origin_world,
                                              const Eigen::Vector3d& direction_world) const {
  const double length = direction_world.norm();
  if (!(length > 0.0)) throw std::invalid_argument("a ray needs a direction");
  Impl& impl = *impl_;
  impl.commit();
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit ray{};
  ray.ray.org_x = static_cast<float>(origin_world.x());
  ray.ray.org_y = static_cast<float>(origin_world.y());
  ray.ray.org_z = static_cast<float>(origin_world.z());
  ray.ray.dir_x = static_cast<float>(direction_world.x() / length);
  ray.ray.dir_y = static_cast<float>(direction_world.y() / length);
  ray.ray.dir_z = static_cast<float>(direction_world.z() / length);
  ray.ray.tfar = kInfinity;
  ray.ray.mask = kHitEverything;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl.world.get(), &context, &ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  const int object = impl.object_of(ray.hit.instID[0]);
  return Hit{ray.ray.tfar, object, impl.normal_world(object, ray.hit.primID)};
}

std::vector<std::uint8_t> Scanner::occluded(const std::vector<Segment>& segments) const {
  impl_->commit();
  RTCIntersectContext context;
  // Not marked coherent: Embree 3.13.5's coherent rtcOccluded16 was seen never to return from a packet of finite,
  // nearly parallel rays. Its rtcIntersect16, which `render` uses, returned from 50 million random packets.
  rtcInitIntersectContext(&context);
  std::vector<std::uint8_t> result(segments.size());
  RTCRay16 packet;
  alignas(64) int valid[kPacket];
  for (std::size_t first = 0; first < segments.size(); first += kPacket) {
    for (std::size_t k = 0; k < kPacket; ++k) {
      valid[k] = first + k < segments.size() ? -1 : 0;
      const Segment& segment = segments[std::min(first + k, segments.size() - 1)];
      packet.org_x[k] = segment.from.x();
      packet.org_y[k] = segment.from.y();
      packet.org_z[k] = segment.from.z();
      packet.dir_x[k] = segment.to.x() - segment.from.x();
      packet.dir_y[k] = segment.to.y() - segment.from.y();
      packet.dir_z[k] = segment.to.z() - segment.from.z();
      packet.tnear[k] = 0.0f;
      packet.tfar[k] = 1.0f;
      packet.time[k] = 0.0f;
      packet.mask[k] = kHitEverything;
      packet.flags[k] = 0;
    }
    rtcOccluded16(valid, impl_->world.get(), &context, &packet);
    for (std::size_t k = 0; k < kPacket && first + k < segments.size(); ++k)
      result[first + k] = packet.tfar[k] < 0.0f ? 1 : 0;  // Embree marks an occluded ray with -infinity
  }
  return result;
}

}  // namespace dofusion
