#include "perception/geom_scanner.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>

#include "perception/embree_handles.h"
#include "perception/geom_rays.h"
#include "perception/pixel_grid.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

// A packet's rays as they are before they are rounded to float; Embree hands its context on to our callbacks.
struct ExactRays : RTCIntersectContext {
  std::array<Vector3d, kPacket> origin, direction;  // by ray id; world
};

// What the callbacks of a geom with a formula need.
struct Primitive {
  GeomType type;
  Vector3d size;
  Eigen::Matrix3d R_geom_world;
  Vector3d p_world;  // the geom's origin

  std::optional<RayHit> hit(const Vector3d& origin_world, const Vector3d& direction_world) const {
    return intersect(type, size, R_geom_world * (origin_world - p_world), R_geom_world * direction_world);
  }
};

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
    if (found && found->along <= RTCRayN_tfar(ray, n, i)) RTCRayN_tfar(ray, n, i) = -kInfinity;
  }
}

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

  void add_primitive(std::size_t geom) {
    geometries[geom].reset(rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_USER));
    RTCGeometry geometry = geometries[geom].get();
    rtcSetGeometryUserPrimitiveCount(geometry, 1);
    rtcSetGeometryUserData(geometry, &primitives[geom]);
    rtcSetGeometryBoundsFunction(
        geometry, [](const RTCBoundsFunctionArguments* arguments) { bound(arguments); }, nullptr);
    rtcSetGeometryIntersectFunction(geometry, intersect_packet);
    rtcSetGeometryOccludedFunction(geometry, occlude_packet);
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
};

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
      impl.add_primitive(i);
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
  check_camera(camera);
  Impl& impl = *impl_;
  impl.commit();
  GeomScan scan{DepthImage(camera.width, camera.height), IdImage(camera.width, camera.height, -1),
                IdImage(camera.width, camera.height, -1),
                NormalImage(camera.width, camera.height, Eigen::Vector3f::Zero())};
  const PixelGrid grid(camera, T_world_camera, 0, 0, camera.width, camera.height, 1);
  const Eigen::Matrix3d R_camera_world = T_world_camera.linear().transpose();
  for_each_tile(grid, threads, [&](int row0, int column0, RTCRayHit16& packet, int* valid) {
    ExactRays rays;
    rtcInitIntersectContext(&rays);
    rays.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    std::array<std::optional<ExactHit>, kPacket> nearest;
    for (int k = 0; k < kPacket; ++k) {
      const auto ray = static_cast<std::size_t>(k);
      rays.origin[ray] = grid.exact_origin;
      rays.direction[ray] = grid.exact_direction(row0 + k / kTile, column0 + k % kTile);
      nearest[ray] = impl.plane_hit(rays.origin[ray], rays.direction[ray]);
      if (nearest[ray]) packet.ray.tfar[k] = static_cast<float>(nearest[ray]->along);
    }
    rtcIntersect16(valid, impl.world.get(), &rays, &packet);
    for (int k = 0; k < kPacket; ++k) {
      if (valid[k] == 0) continue;
      const auto ray = static_cast<std::size_t>(k);
      if (packet.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID) {
        nearest[ray] =
            impl.embree_hit(packet.hit.geomID[k], packet.hit.instID[0][k], packet.hit.primID[k], packet.ray.tfar[k],
                            Vector3d(packet.hit.Ng_x[k], packet.hit.Ng_y[k], packet.hit.Ng_z[k]), rays.origin[ray],
                            rays.direction[ray]);
      }
      if (!nearest[ray]) continue;
      const int row = row0 + k / kTile, column = column0 + k % kTile;
      scan.depth.at(row, column) = static_cast<float>(nearest[ray]->along);
      scan.geoms.at(row, column) = nearest[ray]->geom;
      scan.bodies.at(row, column) = impl.geoms[static_cast<std::size_t>(nearest[ray]->geom)].body;
      scan.normals.at(row, column) = (R_camera_world * nearest[ray]->normal_world).cast<float>();
    }
  });
  return scan;
}

std::optional<GeomScanner::Hit> GeomScanner::cast_ray(const Vector3d& origin_world,
                                                      const Vector3d& direction_world) const {
  const double length = direction_world.norm();
  if (!(length > 0.0) || !std::isfinite(length)) throw std::invalid_argument("a ray needs a direction");
  Impl& impl = *impl_;
  impl.commit();
  ExactRays rays;
  rtcInitIntersectContext(&rays);
  const Vector3d direction = direction_world / length;
  rays.origin[0] = origin_world;
  rays.direction[0] = direction;
  std::optional<ExactHit> nearest = impl.plane_hit(origin_world, direction);
  RTCRayHit ray{};
  ray.ray.org_x = static_cast<float>(origin_world.x());
  ray.ray.org_y = static_cast<float>(origin_world.y());
  ray.ray.org_z = static_cast<float>(origin_world.z());
  ray.ray.dir_x = static_cast<float>(direction.x());
  ray.ray.dir_y = static_cast<float>(direction.y());
  ray.ray.dir_z = static_cast<float>(direction.z());
  ray.ray.tfar = nearest ? static_cast<float>(nearest->along) : kInfinity;
  ray.ray.mask = kHitEverything;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl.world.get(), &rays, &ray);
  if (ray.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
    nearest = impl.embree_hit(ray.hit.geomID, ray.hit.instID[0], ray.hit.primID, ray.ray.tfar,
                              Vector3d(ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z), origin_world, direction);
  }
  if (!nearest) return std::nullopt;
  return Hit{nearest->along, nearest->geom, impl.geoms[static_cast<std::size_t>(nearest->geom)].body,
             nearest->normal_world};
}

std::vector<std::uint8_t> GeomScanner::occluded(const std::vector<Scanner::Segment>& segments) const {
  Impl& impl = *impl_;
  impl.commit();
  std::vector<std::uint8_t> result = occluded_segments(impl.world.get(), segments);
  if (impl.planes.empty()) return result;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (result[i] != 0) continue;
    const Vector3d from = segments[i].from.cast<double>();
    const auto hit = impl.plane_hit(from, segments[i].to.cast<double>() - from);
    if (hit && hit->along <= 1.0) result[i] = 1;
  }
  return result;
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
