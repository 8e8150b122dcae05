#include "apps/scan_mjcf.h"

#include <algorithm>
#include <set>

#include "apps/program.h"
#include "stability/files.h"
#include "stability/geom_mesh.h"
#include "stability/mjcf_scene.h"

namespace dofusion {
namespace {

constexpr int kShownGroups = 3;  // as MuJoCo's viewers start

bool is_shown(const Geom& geom) { return geom.group < kShownGroups && geom.rgba[3] > 0.0f; }

void append(const TriangleMesh& mesh, const Pose& pose, TriangleMesh& to) {
  const int first = static_cast<int>(to.vertices.size());
  for (const Eigen::Vector3d& vertex : mesh.vertices) to.vertices.push_back(pose * vertex);
  for (const Eigen::Vector3i& triangle : mesh.triangles) to.triangles.push_back(triangle.array() + first);
}

ObjectPtr drawn_object(const std::string& name, TriangleMesh mesh) {
  auto object = std::make_shared<Object>();
  object->name = name;
  object->diameter = diameter(mesh);
  object->mesh = std::move(mesh);
  object->convex = false;
  return object;
}

bool equal_shapes(const TriangleMesh& a, const TriangleMesh& b) {
  return a.vertices == b.vertices && a.triangles == b.triangles;
}

std::vector<Pose> poses_of(const MjcfScene& file, const MjcfScanOptions& options) {
  if (!options.settle) return file.initial_poses();
  const SettleResult result = file.settle({}, interrupted);
  if (interrupted()) throw Interrupted("interrupted while the scene settled");
  if (result.status == SettleStatus::kDiverged) throw InputError(options.file + ": the simulation diverges");
  return file.poses(result.T_world_object);
}

// As high as the file's camera sees, in the image that was asked for.
Camera image_of(const SceneCamera& from, const Camera& wanted) {
  Camera camera = camera_of_fovy(from.fovy, wanted.width, wanted.height);
  camera.depth_scale = wanted.depth_scale;
  return camera;
}

// In the file's order.
std::vector<ScanView> views_of(const MjcfScene& file, const MjcfScanOptions& options, const std::vector<Pose>& poses,
                               const Camera& camera) {
  std::vector<ScanView> views;
  if (options.cameras.empty()) return views;
  std::string known;
  std::set<std::string> wanted(options.cameras.begin(), options.cameras.end());
  const bool all = wanted.erase("all") > 0;
  for (const SceneCamera& each : file.cameras()) {
    known += (known.empty() ? "" : ", ") + (each.name.empty() ? "one without a name" : each.name);
    if (wanted.erase(each.name) == 0 && !all) continue;
    views.push_back({each.name, image_of(each, camera), camera_pose(each, poses)});
  }
  if (known.empty()) throw InputError(options.file + ": has no camera; leave --camera out to look from all around");
  if (!wanted.empty())
    throw InputError("--camera: " + options.file + " has no '" + *wanted.begin() + "', but " + known);
  return views;
}

}  // namespace

ScanScenes scan_scenes_of_mjcf(const MjcfScanOptions& options, const Camera& camera) {
  const MjcfScene file(options.file, options.keyframe);
  const std::vector<SceneBody>& bodies = file.bodies();
  GeomScene geoms;
  geoms.T_world_body = poses_of(file, options);
  geoms.object_of_body.assign(bodies.size(), -1);
  for (const SceneBody& body : bodies) geoms.body_names.push_back(body.name);
  std::vector<TriangleMesh> meshes(bodies.size());  // of those that move, in their frames
  for (const Geom& geom : file.geoms()) {
    if (!is_shown(geom)) continue;
    geoms.geoms.push_back(geom);
    const auto body = static_cast<std::size_t>(geom.body);
    if (bodies[body].moves) append(tessellated(geom), geom.T_body_geom, meshes[body]);
  }
  ScanScenes result;
  Scene scene;
  std::vector<int> ids;
  for (std::size_t body = 0; body < bodies.size(); ++body) {
    if (meshes[body].triangles.empty()) continue;
    auto model = std::find_if(result.models.begin(), result.models.end(),
                              [&](const ObjectPtr& other) { return equal_shapes(other->mesh, meshes[body]); });
    if (model == result.models.end()) {
      result.models.push_back(drawn_object(bodies[body].name, std::move(meshes[body])));
      model = result.models.end() - 1;
    }
    geoms.object_of_body[body] = static_cast<int>(scene.objects.size());
    scene.objects.push_back(*model);
    scene.T_world_object.push_back(geoms.T_world_body[body]);
    ids.push_back(static_cast<int>(model - result.models.begin()) + 1);
  }
  if (scene.objects.empty())
    throw InputError(options.file + ": nothing in it moves that can be seen; there is no object");
  check_number_of_objects(scene.objects.size(), options.file);
  result.views = views_of(file, options, geoms.T_world_body, camera);
  result.scenes.push_back(std::move(scene));
  result.ids.push_back(std::move(ids));
  result.geoms = std::move(geoms);
  return result;
}

}  // namespace dofusion
