#include "stability/mjcf_geoms.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <stdexcept>

#include "stability/files.h"
#include "stability/mjcf_objects.h"
#include "stability/mjcf_solids.h"

namespace dofusion {
namespace {

using Eigen::Vector3d;

std::string name_of(const mjModel& model, mjtObj kind, int id) {
  const char* name = mj_id2name(&model, kind, id);
  return name == nullptr ? std::string() : one_line(name);
}

GeomType geom_type(int type) {
  switch (type) {
    case mjGEOM_PLANE:
      return GeomType::kPlane;
    case mjGEOM_HFIELD:
      return GeomType::kHeightField;
    case mjGEOM_SPHERE:
      return GeomType::kSphere;
    case mjGEOM_CAPSULE:
      return GeomType::kCapsule;
    case mjGEOM_ELLIPSOID:
      return GeomType::kEllipsoid;
    case mjGEOM_CYLINDER:
      return GeomType::kCylinder;
    case mjGEOM_BOX:
      return GeomType::kBox;
    case mjGEOM_MESH:
      return GeomType::kMesh;
    default:
      throw std::invalid_argument("a geom of MuJoCo's type " + std::to_string(type));
  }
}

// A texture's mean colour, 0 to 1.
std::array<float, 3> mean_colour(const mjModel& model, int texture) {
  const auto pixels = static_cast<std::ptrdiff_t>(model.tex_width[texture]) * model.tex_height[texture];
  if (pixels <= 0) return {1.0f, 1.0f, 1.0f};
  const mjtByte* rgb = model.tex_rgb + model.tex_adr[texture];
  std::array<double, 3> sum{};
  for (std::ptrdiff_t i = 0; i < 3 * pixels; ++i) sum[static_cast<std::size_t>(i % 3)] += rgb[i];
  std::array<float, 3> mean;
  for (std::size_t k = 0; k < 3; ++k) mean[k] = static_cast<float>(sum[k] / (255.0 * static_cast<double>(pixels)));
  return mean;
}

// As MuJoCo draws it: the geom's own colour if that is not the default's, else its material's; a texture counts with
// its mean.
std::array<float, 4> drawn_colour(const mjModel& model, int geom) {
  constexpr std::array<float, 4> kDefault{0.5f, 0.5f, 0.5f, 1.0f};
  std::array<float, 4> rgba;
  std::copy_n(model.geom_rgba + 4 * geom, 4, rgba.begin());
  const int material = model.geom_matid[geom];
  if (material < 0) return rgba;
  if (rgba == kDefault) std::copy_n(model.mat_rgba + 4 * material, 4, rgba.begin());
  const int texture = model.mat_texid[material];
  if (texture < 0) return rgba;
  const std::array<float, 3> mean = mean_colour(model, texture);
  for (std::size_t k = 0; k < 3; ++k) rgba[k] *= mean[k];
  return rgba;
}

TriangleMesh model_mesh(const mjModel& model, int mesh) {
  TriangleMesh result;
  const float* vertex = model.mesh_vert + 3 * model.mesh_vertadr[mesh];
  for (int i = 0; i < model.mesh_vertnum[mesh]; ++i, vertex += 3) {
    result.vertices.emplace_back(vertex[0], vertex[1], vertex[2]);
  }
  const int* face = model.mesh_face + 3 * model.mesh_faceadr[mesh];
  for (int i = 0; i < model.mesh_facenum[mesh]; ++i, face += 3) {
    result.triangles.emplace_back(face[0], face[1], face[2]);
  }
  return result;
}

HeightField model_height_field(const mjModel& model, int field) {
  HeightField result;
  const mjtNum* size = model.hfield_size + 4 * field;  // half x, half y, top, base
  result.rows = model.hfield_nrow[field];
  result.columns = model.hfield_ncol[field];
  result.half_size = Eigen::Vector2d(size[0], size[1]);
  result.base = size[3];
  const float* data = model.hfield_data + model.hfield_adr[field];
  const auto count = static_cast<std::ptrdiff_t>(result.rows) * result.columns;
  std::transform(data, data + count, std::back_inserter(result.heights),
                 [&](float share) { return static_cast<float>(share * size[2]); });
  return result;
}

// The model's body as an index into `ids`, or -1.
int index_of(const std::vector<int>& ids, int body) {
  const auto found = std::find(ids.begin(), ids.end(), body);
  return found == ids.end() ? -1 : static_cast<int>(found - ids.begin());
}

// Of the bodies `ids` one that `body` is rigidly fixed to, best itself, as an index; -1: none, or it does not move.
int carrier_of(const mjModel& model, const std::vector<int>& ids, int body) {
  if (!body_moves(model, body)) return -1;
  const int own = index_of(ids, body);
  if (own >= 0) return own;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (model.body_weldid[ids[i]] == model.body_weldid[body]) return static_cast<int>(i);
  }
  return -1;
}

// MuJoCo's cameras look along -z with y up.
Pose placed_camera(const mjData& data, int camera) {
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Matrix3d R = Eigen::Map<const RowMajor>(data.cam_xmat + 9 * camera);
  return make_pose(R * Vector3d(1, -1, -1).asDiagonal(), Vector3d(data.cam_xpos + 3 * camera));
}

}  // namespace

Pose centre_pose(const mjData& data, int body) {
  PoseArray pose;
  std::copy_n(data.xipos + 3 * body, 3, pose.begin());
  std::copy_n(data.xquat + 4 * body, 4, pose.begin() + 3);
  return from_array(pose);
}

std::vector<Geom> model_geoms(const mjModel& model, const std::vector<int>& ids, const std::string& path) {
  std::map<int, std::shared_ptr<const TriangleMesh>> meshes;
  std::map<int, std::shared_ptr<const HeightField>> fields;
  std::vector<Geom> geoms;
  for (int id = 0; id < model.ngeom; ++id) {
    const int body = model.geom_bodyid[id], asset = model.geom_dataid[id];
    Geom geom;
    geom.name = name_of(model, mjOBJ_GEOM, id);
    try {
      geom.type = geom_type(model.geom_type[id]);
      geom.size = Vector3d(model.geom_size + 3 * id);
      if (geom.type == GeomType::kMesh) {
        std::shared_ptr<const TriangleMesh>& mesh = meshes[asset];
        if (!mesh) mesh = std::make_shared<TriangleMesh>(model_mesh(model, asset));
        geom.mesh = mesh;
      } else if (geom.type == GeomType::kHeightField) {
        std::shared_ptr<const HeightField>& field = fields[asset];
        if (!field) field = std::make_shared<HeightField>(model_height_field(model, asset));
        geom.height_field = field;
      }
      geom.body = index_of(ids, body);
      // The compiler has moved a mesh's vertices into its inertial frame, and geom_pos and geom_quat with them.
      PoseArray pose;
      std::copy_n(model.geom_pos + 3 * id, 3, pose.begin());
      std::copy_n(model.geom_quat + 4 * id, 4, pose.begin() + 3);
      geom.T_body_geom = Eigen::Translation3d(-Vector3d(model.body_ipos + 3 * body)) * from_array(pose);
      geom.group = model.geom_group[id];
      geom.rgba = drawn_colour(model, id);
      geom.touchable = is_touchable(model, id);
      check_geom(geom);
    } catch (const std::invalid_argument& e) {
      throw InputError(path + ": of '" + body_name(model, body) + "': " + e.what());
    }
    geoms.push_back(std::move(geom));
  }
  return geoms;
}

std::vector<SceneCamera> model_cameras(const mjModel& model, const mjData& data, const std::vector<int>& ids,
                                       const std::string& path) {
  std::vector<SceneCamera> cameras;
  for (int id = 0; id < model.ncam; ++id) {
    SceneCamera camera;
    camera.name = name_of(model, mjOBJ_CAMERA, id);
    if (!(model.cam_fovy[id] > 0.0 && model.cam_fovy[id] < 180.0)) {
      throw InputError(path + ": camera '" + camera.name + "' has a field of view (fovy) of " +
                       std::to_string(model.cam_fovy[id]) + " degrees; it must lie between 0 and 180");
    }
    camera.fovy = model.cam_fovy[id] * M_PI / 180.0;
    const Pose T_world_camera = placed_camera(data, id);
    if (!T_world_camera.matrix().allFinite()) {
      throw InputError(path + ": the pose of camera '" + camera.name + "' is not finite");
    }
    if (model.cam_mode[id] == mjCAMLIGHT_FIXED) camera.body = carrier_of(model, ids, model.cam_bodyid[id]);
    const Pose T_world_body =
        camera.body < 0 ? Pose::Identity() : centre_pose(data, ids[static_cast<std::size_t>(camera.body)]);
    camera.T_body_camera = T_world_body.inverse() * T_world_camera;
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

}  // namespace dofusion
