#include "perception/scanner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

#include "perception/embree_handles.h"
#include "perception/tile_packet.h"
#include "stability/parallel_for.h"

namespace dofusion {
namespace {

constexpr int kBand = 4;  // rows of tiles that a thread takes at a time
constexpr int kMaxObjects = 255 - kLabelFirstObject;

std::vector<Eigen::Vector3d> triangle_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals;
  normals.reserve(mesh.triangles.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    normals.push_back((mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).stableNormalized());
  }
  return normals;
}

constexpr std::array<float, kPacket> kZeros{};

std::uint8_t label_of(int object) {
  return object < 0 ? kLabelTable : static_cast<std::uint8_t>(kLabelFirstObject + object);
}

template <class T>
void resize(Image<T>& image, int width, int height) {
  image.width = width;
  image.height = height;
  image.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
}

static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "normals are written as rows of floats");

// Copies four pixels into each of the tile's rows.
template <class T>
void write_rows(Image<T>& image, int row0, int column0, const void* four_pixels, std::size_t step) {
  for (int row = 0; row < kTile; ++row)
    std::memcpy(static_cast<void*>(&image.at(row0 + row, column0)),
                static_cast<const char*>(four_pixels) + static_cast<std::size_t>(row) * step, kTile * sizeof(T));
}

}  // namespace

struct Scanner::Impl {
  EmbreeDevice device;
  std::vector<ObjectPtr> objects;
  std::vector<EmbreeScene> object_scenes;             // per object
  std::vector<EmbreeGeometry> instances;              // per object, geometry id i of the world
  std::vector<std::vector<Eigen::Vector3d>> normals;  // per object and triangle, in the object's frame
  std::vector<Eigen::Matrix3d> R_world_object;        // per object
  Table table;
  EmbreeScene world;
  int threads = 1;
  bool changed = true;  // since the world was last committed

  void commit() {
    if (!changed) return;
    rtcCommitScene(world.get());
    check_embree(device.get());
    changed = false;
  }

  // An object's hit carries its instance, which is the object's index, the table's none.
  int object_of(unsigned instance) const {
    return instance == RTC_INVALID_GEOMETRY_ID ? -1 : static_cast<int>(instance);
  }
  Eigen::Vector3d normal_world(int object, unsigned triangle) const {
    if (object < 0) return Eigen::Vector3d::UnitZ();
    return R_world_object[object] * normals[object][triangle];
  }

  class TileWriter;
  void render_grid(const PixelGrid& grid, const Pose& T_world_camera, int thread_count, Scan& scan) const;
};

Scanner::Scanner(std::vector<ObjectPtr> objects, const ScannerOptions& options) : impl_(std::make_unique<Impl>()) {
  if (objects.size() > kMaxObjects)
    throw std::invalid_argument("a scanner labels at most " + std::to_string(kMaxObjects) + " objects, not " +
                                std::to_string(objects.size()));
  if (!(options.table_half_size > 0.0))
    throw std::invalid_argument("table_half_size must be positive, not " + std::to_string(options.table_half_size));
  if (options.threads < 1)
    throw std::invalid_argument("a scanner needs at least one thread, not " + std::to_string(options.threads));
  Impl& impl = *impl_;
  impl.threads = options.threads;
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
  if (options.table) impl.table.half_size = static_cast<float>(options.table_half_size);
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

// Writes the hits of a tile into the images. Neighbouring rays mostly hit the same triangle, so that what belongs to a
// triangle is kept until another one comes.
class Scanner::Impl::TileWriter {
 public:
  TileWriter(const Impl& impl, const Pose& T_world_camera, Scan& scan)
      : impl_(impl),
        R_camera_world_(T_world_camera.linear().transpose()),
        scan_(scan),
        normals_(!scan.normals.pixels.empty()) {}

  void write(const TilePacket& tile, int row0, int column0) {
    if (tile.uniform())
      write_uniform(tile, row0, column0);
    else
      write_each(tile, row0, column0);
  }

 private:
  void write_uniform(const TilePacket& tile, int row0, int column0) {
    look_up(tile, 0);
    write_rows(scan_.depth, row0, column0, tile.hit(0) ? tile.depths() : kZeros.data(), kTile * sizeof(float));
    const std::array<std::uint8_t, kTile> labels{label_, label_, label_, label_};
    write_rows(scan_.labels, row0, column0, labels.data(), 0);
    if (!normals_) return;
    const std::array<Eigen::Vector3f, kTile> normals{normal_, normal_, normal_, normal_};
    write_rows(scan_.normals, row0, column0, normals.data(), 0);
  }

  void write_each(const TilePacket& tile, int row0, int column0) {
    for (int row = 0; row < tile.rows(); ++row)
      for (int column = 0; column < tile.columns(); ++column) {
        const int k = row * kTile + column;
        look_up(tile, k);
        scan_.depth.at(row0 + row, column0 + column) = tile.hit(k) ? tile.depths()[k] : 0.0f;
        scan_.labels.at(row0 + row, column0 + column) = label_;
        if (normals_) scan_.normals.at(row0 + row, column0 + column) = normal_;
      }
  }

  // Label and normal of what ray k hit.
  void look_up(const TilePacket& tile, int k) {
    if (!tile.hit(k)) {
      known_ = false;
      label_ = kLabelNothing;
      normal_.setZero();
      return;
    }
    if (known_ && instance_ == tile.instance(k) && triangle_ == tile.triangle(k)) return;
    known_ = true;
    instance_ = tile.instance(k);
    triangle_ = tile.triangle(k);
    const int object = impl_.object_of(instance_);
    label_ = label_of(object);
    if (normals_) normal_ = (R_camera_world_ * impl_.normal_world(object, triangle_)).cast<float>();
  }

  const Impl& impl_;
  Eigen::Matrix3d R_camera_world_;
  Scan& scan_;
  bool normals_;        // are wanted
  bool known_ = false;  // the last ray hit the triangle below
  unsigned instance_ = 0, triangle_ = 0;
  std::uint8_t label_ = kLabelNothing;
  Eigen::Vector3f normal_ = Eigen::Vector3f::Zero();  // camera frame
};

// Fills the images, whose sizes are the grid's; normals only if there are any.
void Scanner::Impl::render_grid(const PixelGrid& grid, const Pose& T_world_camera, int thread_count, Scan& scan) const {
  const std::int64_t tile_rows = (grid.rows + kTile - 1) / kTile;
  const std::int64_t bands = (tile_rows + kBand - 1) / kBand;
  parallel_for(bands, thread_count, [&](std::int64_t band, int) {
    TilePacket tile(grid, table);
    TileWriter writer(*this, T_world_camera, scan);
    const int end = static_cast<int>(std::min(tile_rows, (band + 1) * kBand)) * kTile;
    for (int row0 = static_cast<int>(band) * kBand * kTile; row0 < end; row0 += kTile)
      for (int column0 = 0; column0 < grid.columns; column0 += kTile) {
        tile.cast(world.get(), row0, column0);
        writer.write(tile, row0, column0);
      }
  });
}

Scan Scanner::render(const Camera& camera, const Pose& T_world_camera) const {
  Scan scan;
  render(camera, T_world_camera, scan);
  return scan;
}

void Scanner::render(const Camera& camera, const Pose& T_world_camera, Scan& scan) const {
  check_camera(camera);
  impl_->commit();
  resize(scan.depth, camera.width, camera.height);
  resize(scan.labels, camera.width, camera.height);
  resize(scan.normals, camera.width, camera.height);
  const PixelGrid grid(camera, T_world_camera, 0, 0, camera.width, camera.height, 1);
  impl_->render_grid(grid, T_world_camera, impl_->threads, scan);
}

Scan Scanner::render_window(const Camera& camera, const Pose& T_world_camera, int u0, int v0, int u1, int v1,
                            int stride) const {
  check_camera(camera);
  if (u1 <= u0 || v1 <= v0 || stride <= 0)
    throw std::invalid_argument("the window [" + std::to_string(u0) + ", " + std::to_string(u1) + ") x [" +
                                std::to_string(v0) + ", " + std::to_string(v1) + ") with stride " +
                                std::to_string(stride) + " has no pixels");
  impl_->commit();
  const PixelGrid grid(camera, T_world_camera, u0, v0, u1, v1, stride);
  Scan scan{DepthImage(grid.columns, grid.rows), LabelImage(grid.columns, grid.rows), NormalImage()};
  impl_->render_grid(grid, T_world_camera, 1, scan);
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
  const float table =
      impl.table.distance(ray.ray.org_x, ray.ray.org_y, ray.ray.org_z, ray.ray.dir_x, ray.ray.dir_y, ray.ray.dir_z);
  if (table < ray.ray.tfar) return Hit{table, -1, impl.normal_world(-1, 0)};
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
    for (std::size_t k = 0; k < kPacket && first + k < segments.size(); ++k) {
      const float table = impl_->table.distance(packet.org_x[k], packet.org_y[k], packet.org_z[k], packet.dir_x[k],
                                                packet.dir_y[k], packet.dir_z[k]);
      // Embree marks an occluded ray with -infinity.
      result[first + k] = packet.tfar[k] < 0.0f || table <= 1.0f ? 1 : 0;
    }
  }
  return result;
}

}  // namespace dofusion
