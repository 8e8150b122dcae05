#include "stability/mjcf_scene.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "stability/files.h"
#include "stability/mjcf_geoms.h"
#include "stability/mjcf_objects.h"
#include "stability/mjcf_solids.h"
#include "stability/simulation.h"

namespace dofusion {
namespace {

constexpr double kMostSteps = 1e7;

bool all_finite(const mjtNum* values, int count) {
  return std::all_of(values, values + count, [](mjtNum x) { return std::isfinite(x); });
}

// MuJoCo builds models of numbers that mean nothing.
void check_numbers(const mjModel& model, const std::string& path) {
  if (model.ngeom == 0) throw InputError(path + ": an empty scene: it has no geom");
  if (!(model.opt.timestep > 0.0) || !std::isfinite(model.opt.timestep)) {
    throw InputError(path + ": its time step is not a positive number of seconds");
  }
  if (!all_finite(model.opt.gravity, 3)) throw InputError(path + ": its gravity is not finite");
  for (int body = 0; body < model.nbody; ++body) {
    const bool finite = all_finite(model.body_pos + 3 * body, 3) && all_finite(model.body_quat + 4 * body, 4) &&
                        all_finite(model.body_ipos + 3 * body, 3);
    if (!finite) throw InputError(path + ": the pose of '" + body_name(model, body) + "' is not finite");
    if (!std::isfinite(model.body_mass[body]) || !all_finite(model.body_inertia + 3 * body, 3)) {
      throw InputError(path + ": the mass of '" + body_name(model, body) + "' is not finite");
    }
  }
  for (int geom = 0; geom < model.ngeom; ++geom) {
    const bool finite = all_finite(model.geom_size + 3 * geom, 3) && all_finite(model.geom_pos + 3 * geom, 3) &&
                        all_finite(model.geom_quat + 4 * geom, 4);
    if (finite) continue;
    throw InputError(path + ": a geom of '" + body_name(model, model.geom_bodyid[geom]) +
                     "' has a size or pose that is not finite");
  }
  if (!all_finite(model.qpos0, model.nq)) throw InputError(path + ": a joint's position is not finite");
}

// -1: none asked for.
int find_keyframe(const mjModel& model, const std::string& keyframe, const std::string& path) {
  if (keyframe.empty()) return -1;
  const auto checked = [&](int key) {
    const bool finite = all_finite(model.key_qpos + key * model.nq, model.nq) &&
                        all_finite(model.key_qvel + key * model.nv, model.nv) &&
                        all_finite(model.key_ctrl + key * model.nu, model.nu);
    if (!finite) throw InputError(path + ": keyframe '" + keyframe + "' is not finite");
    return key;
  };
  const int named = mj_name2id(&model, mjOBJ_KEY, keyframe.c_str());
  if (named >= 0) return checked(named);
  std::string known;
  for (int key = 0; key < model.nkey; ++key) {
    if (keyframe == std::to_string(key)) return checked(key);
    const char* name = mj_id2name(&model, mjOBJ_KEY, key);
    known += (key == 0 ? "" : ", ") + std::to_string(key) + (name == nullptr ? "" : " (" + one_line(name) + ")");
  }
  throw InputError(path + ": has no keyframe '" + keyframe + "'; " +
                   (known.empty() ? "it has none at all" : "it has " + known));
}

void check_count(const std::vector<Pose>& T_world_moving, const std::vector<int>& moving) {
  if (T_world_moving.size() == moving.size()) return;
  throw std::invalid_argument(std::to_string(T_world_moving.size()) + " poses for " + std::to_string(moving.size()) +
                              " moving bodies");
}

}  // namespace

struct MjcfScene::Impl {
  std::string path;
  int keyframe = -1;
  std::vector<SceneBody> bodies;
  std::vector<int> ids;     // of the bodies in the model
  std::vector<int> moving;  // indices into bodies
  std::vector<Geom> geoms;
  std::vector<SceneCamera> cameras;
  std::unique_ptr<Simulation> simulation;

  void load(const std::string& keyframe_name) {
    ModelPtr model = load_mjcf(path);
    check_numbers(*model, path);
    keyframe = find_keyframe(*model, keyframe_name, path);
    std::vector<Simulation::Body> simulated;
    for (int id = 0; id < model->nbody; ++id) {
      if (model->body_geomnum[id] == 0) continue;
      const bool moves = body_moves(*model, id);
      bodies.push_back(
          {id == 0 ? "world" : body_name(*model, id), moves, body_diameter(*model, id), model->body_mass[id]});
      ids.push_back(id);
      if (!moves) continue;
      moving.push_back(static_cast<int>(bodies.size()) - 1);
      simulated.push_back({id, bodies.back().diameter});
    }
    try {
      simulation = std::make_unique<Simulation>(std::move(model), std::move(simulated));
    } catch (const MujocoError& e) {
      throw InputError(path + ": " + e.what());
    }
    geoms = model_geoms(simulation->model(), ids, path);
    simulation->reset(keyframe);
    simulation->place_cameras();
    cameras = model_cameras(simulation->model(), simulation->data(), ids, path);
  }

  // The state to start from, kinematics included.
  const mjData& start() const {
    simulation->reset(keyframe);
    simulation->poses();
    return simulation->data();
  }
};

MjcfScene::MjcfScene(const std::string& path, const std::string& keyframe) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  impl_->load(keyframe);
}

MjcfScene::~MjcfScene() = default;
MjcfScene::MjcfScene(MjcfScene&&) noexcept = default;
MjcfScene& MjcfScene::operator=(MjcfScene&&) noexcept = default;
const std::vector<SceneBody>& MjcfScene::bodies() const { return impl_->bodies; }
const std::vector<int>& MjcfScene::moving() const { return impl_->moving; }

std::vector<Pose> MjcfScene::initial_poses() const {
  const mjData& data = impl_->start();
  std::vector<Pose> poses;
  for (const int id : impl_->ids) poses.push_back(centre_pose(data, id));
  return poses;
}

std::vector<Pose> MjcfScene::poses(const std::vector<Pose>& T_world_moving) const {
  check_count(T_world_moving, impl_->moving);
  std::vector<Pose> all = initial_poses();
  for (std::size_t i = 0; i < T_world_moving.size(); ++i) {
    all[static_cast<std::size_t>(impl_->moving[i])] = T_world_moving[i];
  }
  return all;
}

const std::vector<Geom>& MjcfScene::geoms() const { return impl_->geoms; }
const std::vector<SceneCamera>& MjcfScene::cameras() const { return impl_->cameras; }

SettleResult MjcfScene::settle(const PhysicsOptions& options, const std::function<bool()>& stop) const {
  const mjModel& model = impl_->simulation->model();
  SettleResult still;
  still.status = SettleStatus::kSettled;
  if (impl_->moving.empty()) return still;
  if (options.time_limit / model.opt.timestep > kMostSteps) {
    throw InputError(impl_->path + ": its time step is too short to simulate " + std::to_string(options.time_limit) +
                     " s");
  }
  Loads loads;
  loads.gravity = Eigen::Vector3d(model.opt.gravity);
  impl_->start();
  try {
    return impl_->simulation->settle(options, loads, {options.time_limit, true, stop}, {});
  } catch (const MujocoError& e) {
    throw InputError(impl_->path + ": cannot be simulated with its settings: " + e.what());
  }
}

Scene MjcfScene::to_scene() const {
  std::vector<Pose> poses;
  const std::vector<Pose> all = initial_poses();
  for (const int index : impl_->moving) poses.push_back(all[static_cast<std::size_t>(index)]);
  return to_scene(poses);
}

Scene MjcfScene::to_scene(const std::vector<Pose>& T_world_moving) const {
  check_count(T_world_moving, impl_->moving);
  const mjModel& model = impl_->simulation->model();
  const mjData& data = impl_->start();
  Scene scene;
  for (const FreeObject& found : free_objects(model, data, impl_->path)) {
    // Some body that is listed moves with the object: how its centre of mass went tells how the object went.
    for (std::size_t i = 0; i < T_world_moving.size(); ++i) {
      const int id = impl_->ids[static_cast<std::size_t>(impl_->moving[i])];
      if (model.body_weldid[id] != found.body) continue;
      PoseArray root;
      std::copy_n(data.xpos + 3 * found.body, 3, root.begin());
      std::copy_n(data.xquat + 4 * found.body, 4, root.begin() + 3);
      scene.objects.push_back(found.object);
      scene.T_world_object.push_back(T_world_moving[i] * centre_pose(data, id).inverse() * from_array(root) *
                                     found.T_body_object);
      break;
    }
  }
  return scene;
}

}  // namespace dofusion
