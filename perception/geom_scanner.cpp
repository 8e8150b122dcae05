#include "perception/geom_scanner.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>

#include "perception/embree_handles.h"
#include "perception/geom_primitives.h"
#include "perception/tile_packet.h"
#include "stability/parallel_for.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

// Of a mesh's triangle in the geom's frame.
struct TrianglePlane {
  Vector3d point, normal;  // unit, outward
};

std::vector<TrianglePlane> triangle_planes(const TriangleMesh& mesh) {
  std::vector<TrianglePlane> planes;
  planes.reserve(mesh.triangles.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Vector3d& a = mesh.vertices[static_cast<std::size_t>(t[0])];
    const Vector3d across =
        (mesh.vertices[static_cast<std::size_t>(t[1])] - a).cross(mesh.vertices[static_cast<std::size_t>(t[2])] - a);
    planes.push_back({a, across.stableNormalized()});
  }
  return planes;
}

// Embree's tree over a mesh, shared by all geoms that have the mesh.
struct MeshTree {
  EmbreeScene scene;
  std::vector<TrianglePlane> planes;
};
using MeshTreePtr = std::shared_ptr<const MeshTree>;

// A nearest hit, worked out in double.
struct ExactHit {
  double along;
  int geom;
  Vector3d normal_world;
};

}  // namespace

struct GeomScanner::Impl {
  EmbreeDevice device;
  std::vector<Geom> geoms;
  std::vector<Pose> T_world_geom;
  std::vector<Primitive> primitives;       // per geom; Embree keeps their addresses
  std::vector<MeshTreePtr> trees;          // per geom; null for primitives
  std::vector<EmbreeGeometry> geometries;  // per geom, its geometry id in the world; null for planes
  std::vector<int> planes;                 // geoms that are planes: they may have no end, so that no tree holds them
  std::vector<bool> hidden;                // per geom, by set_visible
  std::array<bool, 6> groups{};
  EmbreeScene world;
  bool changed = true;  // since the world was last committed

  bool shown(std::size_t geom) const {
    const int group = std::clamp(geoms[geom].group, 0, 5);
    return groups[static_cast<std::size_t>(group)] && !hidden[geom] && geoms[geom].rgba[3] > 0.0f;
  }

  void add_mesh(std::size_t geom, std::map<const void*, MeshTreePtr>& known) {
    const Geom& g = geoms[geom];
    const bool is_mesh = g.type == GeomType::kMesh;
    MeshTreePtr& tree = known[is_mesh ? static_cast<const void*>(g.mesh.get()) : g.height_field.get()];
    if (!tree) {
      const TriangleMesh landscape = is_mesh ? TriangleMesh() : height_field_mesh(*g.height_field);
      const TriangleMesh& mesh = is_mesh ? *g.mesh : landscape;
      tree = std::make_shared<MeshTree>(MeshTree{make_triangle_scene(device.get(), mesh), triangle_planes(mesh)});
    }
    trees[geom] = tree;
    geometries[geom].reset(rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(geometries[geom].get(), tree->scene.get());
    rtcSetGeometryTimeStepCount(geometries[geom].get(), 1);
  }

  void update_visibility() {
    for (std::size_t i = 0; i < geoms.size(); ++i) {
      if (!geometries[i]) continue;
      if (shown(i)) {
        rtcEnableGeometry(geometries[i].get());
      } else {
        rtcDisableGeometry(geometries[i].get());
      }
    }
    changed = true;
  }

  void commit() {
    if (!changed) return;
    rtcCommitScene(world.get());
    check_embree(device.get());
    changed = false;
  }

  // The nearest plane, and how far along the ray.
  std::optional<ExactHit> plane_hit(const Vector3d& origin, const Vector3d& direction) const {
    std::optional<ExactHit> nearest;
    for (const int plane : planes) {
      const auto index = static_cast<std::size_t>(plane);
      if (!shown(index)) continue;
      const auto found = primitives[index].hit(origin, direction);
      if (found && (!nearest || found->along < nearest->along)) {
        nearest = ExactHit{found->along, plane, T_world_geom[index].linear() * found->normal};
      }
    }
    return nearest;
  }

  // What Embree found with the exact ray, in double.
  ExactHit embree_hit(unsigned geometry, unsigned instance, unsigned triangle, float along, const Vector3d& Ng,
                      const Vector3d& origin, const Vector3d& direction) const {
    if (instance == RTC_INVALID_GEOMETRY_ID) {
      const auto found = primitives[geometry].hit(origin, direction);
      return {found ? found->along : static_cast<double>(along), static_cast<int>(geometry), Ng};
    }
    const TrianglePlane& plane = trees[instance]->planes[triangle];
    const Pose& T = T_world_geom[instance];
    ExactHit hit{static_cast<double>(along), static_cast<int>(instance), T.linear() * plane.normal};
    const double towards = hit.normal_world.dot(direction);
    // Nearly along the triangle its plane says little about how far.
    constexpr double kGrazing = 1e-4;
    if (std::abs(towards) > kGrazing * direction.norm()) {
      hit.along = hit.normal_world.dot(T * plane.point - origin) / towards;
    }
    return hit;
  }

  // The nearer of what Embree found, if it found anything, and the planes.
  std::optional<ExactHit> nearest(const RTCRayHit16& packet, int k, const ExactRays& rays) const {
    const auto ray = static_cast<std::size_t>(k);
    std::optional<ExactHit> hit = plane_hit(rays.origin[ray], rays.direction[ray]);
    if (packet.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) return hit;
    const ExactHit found =
        embree_hit(packet.hit.geomID[k], packet.hit.instID[0][k], packet.hit.primID[k], packet.ray.tfar[k],
                   {packet.hit.Ng_x[k], packet.hit.Ng_y[k], packet.hit.Ng_z[k]}, rays.origin[ray], rays.direction[ray]);
    return hit && hit->along <= found.along ? hit : found;
  }
};

// Casts the packet's valid rays. (Planes are laid over what they hit, not used to shorten them: see Scanner::occluded.)
void cast_packet(RTCScene world, const int* valid, ExactRays& rays, bool coherent, RTCRayHit16& packet) {
  rtcInitIntersectContext(&rays);
  if (coherent) rays.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  for (int k = 0; k < kPacket; ++k) {
    const auto ray = static_cast<std::size_t>(k);
    const Eigen::Vector3f origin = rays.origin[ray].cast<float>(), direction = rays.direction[ray].cast<float>();
    packet.ray.org_x[k] = origin.x();
    packet.ray.org_y[k] = origin.y();
    packet.ray.org_z[k] = origin.z();
    packet.ray.dir_x[k] = direction.x();
    packet.ray.dir_y[k] = direction.y();
    packet.ray.dir_z[k] = direction.z();
    packet.ray.tnear[k] = 0.0f;
    packet.ray.tfar[k] = kInfinity;
    packet.ray.time[k] = 0.0f;
    packet.ray.mask[k] = kHitEverything;
    packet.ray.id[k] = static_cast<unsigned>(k);
    packet.ray.flags[k] = 0;
    packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.primID[k] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
  }
  rtcIntersect16(valid, world, &rays, &packet);
}

GeomScanner::GeomScanner(std::vector<Geom> geoms, const GeomScannerOptions& options) : impl_(std::make_unique<Impl>()) {
  for (const Geom& geom : geoms) check_geom(geom);
  Impl& impl = *impl_;
  impl.geoms = std::move(geoms);
  impl.groups = options.groups;
  const std::size_t count = impl.geoms.size();
  impl.T_world_geom.resize(count);
  impl.primitives.resize(count);
  impl.trees.resize(count);
  impl.geometries.resize(count);
  impl.hidden.resize(count, false);
  impl.device = make_embree_device();
  impl.world.reset(rtcNewScene(impl.device.get()));
  rtcSetSceneFlags(impl.world.get(), static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC));
  std::map<const void*, MeshTreePtr> known;
  int bodies = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Geom& geom = impl.geoms[i];
    bodies = std::max(bodies, geom.body + 1);
    if (geom.body < 0) throw std::invalid_argument("geom '" + geom.name + "': it has no body");
    impl.primitives[i].type = geom.type;
    impl.primitives[i].size = geom.size;
    if (geom.type == GeomType::kPlane) {
      impl.planes.push_back(static_cast<int>(i));
      continue;
    }
    if (geom.type == GeomType::kMesh || geom.type == GeomType::kHeightField) {
      impl.add_mesh(i, known);
    } else {
      impl.geometries[i] = make_primitive(impl.device.get(), &impl.primitives[i]);
    }
    rtcAttachGeometryByID(impl.world.get(), impl.geometries[i].get(), static_cast<unsigned>(i));
  }
  set_poses(std::vector<Pose>(static_cast<std::size_t>(bodies), Pose::Identity()));
  impl.update_visibility();
}

GeomScanner::~GeomScanner() = default;
GeomScanner::GeomScanner(GeomScanner&&) noexcept = default;
GeomScanner& GeomScanner::operator=(GeomScanner&&) noexcept = default;
const std::vector<Geom>& GeomScanner::geoms() const { return impl_->geoms; }

void GeomScanner::set_poses(const std::vector<Pose>& T_world_body) {
  Impl& impl = *impl_;
  for (const Geom& geom : impl.geoms) {
    if (static_cast<std::size_t>(geom.body) >= T_world_body.size())
      throw std::invalid_argument(std::to_string(T_world_body.size()) + " poses, but there is a body " +
                                  std::to_string(geom.body));
    if (!T_world_body[static_cast<std::size_t>(geom.body)].matrix().allFinite())
      throw std::invalid_argument("the pose of body " + std::to_string(geom.body) + " is not finite");
  }
  for (std::size_t i = 0; i < impl.geoms.size(); ++i) {
    const Pose T = T_world_body[static_cast<std::size_t>(impl.geoms[i].body)] * impl.geoms[i].T_body_geom;
    impl.T_world_geom[i] = T;
    impl.primitives[i].R_geom_world = T.linear().transpose();
    impl.primitives[i].p_world = T.translation();
    if (!impl.geometries[i]) continue;
    RTCGeometry geometry = impl.geometries[i].get();
    if (impl.trees[i]) {
      const Eigen::Matrix<float, 3, 4> columns = T.matrix().topRows<3>().cast<float>();
      rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns.data());
    }
    rtcCommitGeometry(geometry);
  }
  impl.changed = true;
}

void GeomScanner::set_group_visible(int group, bool visible) {
  if (group < 0 || group > 5) throw std::invalid_argument("groups are 0 to 5, not " + std::to_string(group));
  impl_->groups[static_cast<std::size_t>(group)] = visible;
  impl_->update_visibility();
}

void GeomScanner::set_visible(int geom, bool visible) {
  if (geom < 0 || static_cast<std::size_t>(geom) >= impl_->geoms.size())
    throw std::invalid_argument("there is no geom " + std::to_string(geom));
  impl_->hidden[static_cast<std::size_t>(geom)] = !visible;
  impl_->update_visibility();
}

GeomScan GeomScanner::render(const Camera& camera, const Pose& T_world_camera, int threads) const {
  if (camera.width <= 0 || camera.height <= 0 || !(camera.fx > 0.0) || !(camera.fy > 0.0))
    throw std::invalid_argument("a camera needs a positive size and focal length");
  Impl& impl = *impl_;
  impl.commit();
  GeomScan scan{DepthImage(camera.width, camera.height), IdImage(camera.width, camera.height, -1),
                IdImage(camera.width, camera.height, -1),
                NormalImage(camera.width, camera.height, Eigen::Vector3f::Zero())};
  const Eigen::Matrix3d R_world_camera = T_world_camera.linear();
  const auto render_tile = [&](int row0, int column0) {
    ExactRays rays;
    RTCRayHit16 packet;
    alignas(64) int valid[kPacket];
    for (int k = 0; k < kPacket; ++k) {
      const int row = row0 + k / kTile, column = column0 + k % kTile;
      valid[k] = row < camera.height && column < camera.width ? -1 : 0;
      rays.origin[static_cast<std::size_t>(k)] = T_world_camera.translation();
      // Of length 1 along the optical axis, so that how far along the ray is the z-depth.
      rays.direction[static_cast<std::size_t>(k)] = R_world_camera * unproject(camera, column, row, 1.0);
    }
    cast_packet(impl.world.get(), valid, rays, true, packet);
    for (int k = 0; k < kPacket; ++k) {
      if (valid[k] == 0) continue;
      const std::optional<ExactHit> hit = impl.nearest(packet, k, rays);
      if (!hit) continue;
      const int row = row0 + k / kTile, column = column0 + k % kTile;
      scan.depth.at(row, column) = static_cast<float>(hit->along);
      scan.geoms.at(row, column) = hit->geom;
      scan.bodies.at(row, column) = impl.geoms[static_cast<std::size_t>(hit->geom)].body;
      scan.normals.at(row, column) = (R_world_camera.transpose() * hit->normal_world).cast<float>();
    }
  };
  parallel_for((camera.height + kTile - 1) / kTile, threads, [&](std::int64_t tile_row, int) {
    for (int column0 = 0; column0 < camera.width; column0 += kTile) {
      render_tile(static_cast<int>(tile_row) * kTile, column0);
    }
  });
  return scan;
}

std::optional<GeomScanner::Hit> GeomScanner::cast_ray(const Vector3d& origin_world,
                                                      const Vector3d& direction_world) const {
  const double length = direction_world.norm();
  if (!(length > 0.0) || !std::isfinite(length)) throw std::invalid_argument("a ray needs a direction");
  impl_->commit();
  ExactRays rays;
  rays.origin.fill(origin_world);
  rays.direction.fill(direction_world / length);
  RTCRayHit16 packet;
  alignas(64) int valid[kPacket] = {-1};
  cast_packet(impl_->world.get(), valid, rays, false, packet);
  const std::optional<ExactHit> hit = impl_->nearest(packet, 0, rays);
  if (!hit) return std::nullopt;
  return Hit{hit->along, hit->geom, impl_->geoms[static_cast<std::size_t>(hit->geom)].body, hit->normal_world};
}

std::vector<std::uint8_t> GeomScanner::occluded(const std::vector<Scanner::Segment>& segments) const {
  Impl& impl = *impl_;
  impl.commit();
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);  // not marked coherent: see Scanner::occluded
  std::vector<std::uint8_t> result(segments.size());
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Eigen::Vector3f from = segments[i].from, along = segments[i].to - from;
    RTCRay ray{};
    ray.org_x = from.x();
    ray.org_y = from.y();
    ray.org_z = from.z();
    ray.dir_x = along.x();
    ray.dir_y = along.y();
    ray.dir_z = along.z();
    ray.tfar = 1.0f;
    ray.mask = kHitEverything;
    rtcOccluded1(impl.world.get(), &context, &ray);
    const auto plane = impl.plane_hit(from.cast<double>(), along.cast<double>());
    result[i] = ray.tfar < 0.0f || (plane && plane->along <= 1.0) ? 1 : 0;  // Embree: -infinity if occluded
  }
  return result;
}

AngleImage incidence_angles(const NormalImage& normals, const Camera& camera) {
  AngleImage angles(normals.width, normals.height);
  for (int row = 0; row < normals.height; ++row) {
    for (int column = 0; column < normals.width; ++column) {
      const Vector3d normal = normals.at(row, column).cast<double>();
      if (normal.isZero()) continue;
      const Vector3d back = -unproject(camera, column, row, 1.0);
      angles.at(row, column) = static_cast<float>(std::atan2(normal.cross(back).norm(), normal.dot(back)));
    }
  }
  return angles;
}

Scan labelled(const GeomScan& scan, const std::vector<std::uint8_t>& label_of_body) {
  Scan result{scan.depth, LabelImage(scan.depth.width, scan.depth.height), scan.normals};
  for (std::size_t i = 0; i < scan.bodies.pixels.size(); ++i) {
    const std::int32_t body = scan.bodies.pixels[i];
    if (body < 0) continue;
    if (static_cast<std::size_t>(body) >= label_of_body.size())
      throw std::invalid_argument("body " + std::to_string(body) + " is seen and has no label");
    result.labels.pixels[i] = label_of_body[static_cast<std::size_t>(body)];
  }
  return result;
}

}  // namespace dofusion
