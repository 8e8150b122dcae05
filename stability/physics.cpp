#include "stability/physics.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <list>
#include <map>
#include <mutex>
#include <set>
#include <stdexcept>

#include "stability/mjcf.h"

namespace dofusion {
namespace {

struct ModelDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DataDeleter {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPtr = std::unique_ptr<mjModel, ModelDeleter>;
using DataPtr = std::unique_ptr<mjData, DataDeleter>;

void ignore_warning(const char*) {}  // warnings are read from mjData; MuJoCo's own handler writes a log file

// MuJoCo must not return from an error (its memory ran out), and its own handler waits for a key.
void exit_on_error(const char* message) {
  std::fprintf(stderr, "MuJoCo: %s\n", message);
  std::_Exit(1);
}

ModelPtr compile(const std::string& mjcf) {
  // The XML reader keeps process-wide state.
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  mju_user_warning = ignore_warning;
  mju_user_error = exit_on_error;
  const auto vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  const char* name = "scene.xml";
  if (mj_makeEmptyFileVFS(vfs.get(), name, static_cast<int>(mjcf.size())) != 0) {
    throw std::runtime_error("MuJoCo: no memory for the scene's XML");
  }
  std::memcpy(vfs->filedata[mj_findFileVFS(vfs.get(), name)], mjcf.data(), mjcf.size());
  char error[1000] = "";
  ModelPtr model(mj_loadXML(name, vfs.get(), error, sizeof error));
  mj_deleteVFS(vfs.get());
  if (!model) throw std::runtime_error(std::string("MuJoCo cannot build the scene: ") + error);
  return model;
}

// Also where contacts were dropped for want of room: what follows from the rest would be a false verdict.
bool diverged(const mjData* data) {
  if (data->warning[mjWARN_CONTACTFULL].number > 0 || data->warning[mjWARN_CNSTRFULL].number > 0) return true;
  return data->warning[mjWARN_BADQPOS].number > 0 || data->warning[mjWARN_BADQVEL].number > 0 ||
         data->warning[mjWARN_BADQACC].number > 0;
}

}  // namespace

std::string to_string(SettleStatus status) {
  switch (status) {
    case SettleStatus::kSettled: return "settled";
    case SettleStatus::kTimeLimit: return "time_limit";
    case SettleStatus::kDiverged: return "diverged";
  }
  return "unknown";
}

struct Simulator::Impl {
  std::vector<ObjectPtr> objects;
  PhysicsOptions options;
  ModelPtr model;
  DataPtr data;

  void start_at(const std::vector<Pose>& poses) {
    mj_resetData(model.get(), data.get());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const PoseArray pose = to_array(poses[i]);
      std::copy(pose.begin(), pose.end(), data->qpos + 7 * i);
    }
    mj_forward(model.get(), data.get());
  }

  std::vector<Pose> poses() const {
    std::vector<Pose> result;
    for (std::size_t i = 0; i < objects.size(); ++i) {
      PoseArray pose;
      std::copy_n(data->qpos + 7 * i, 7, pose.begin());
      result.push_back(from_array(pose));
    }
    return result;
  }

  // Every object is still within the rest tolerances of `anchor` (7 numbers an object, as qpos).
  bool near(const std::vector<mjtNum>& anchor) const {
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const mjtNum *p = data->qpos + 7 * i, *q = anchor.data() + 7 * i;
      if (mju_dist3(p, q) > options.rest_shift * objects[i]->diameter) return false;
      // |<p, q>| is the cosine of half the angle between the two rotations.
      const double cosine = std::abs(mju_dot(p + 3, q + 3, 4));
      if (cosine < std::cos(0.5 * options.rest_turn)) return false;
    }
    return true;
  }

  double deepest_penetration() const {
    double depth = 0.0;
    for (int i = 0; i < data->ncon; ++i) {
      const mjContact& contact = data->contact[i];
      depth = std::max(depth, contact.dist < 0.0 && is_halved(contact) ? -2.0 * contact.dist : -contact.dist);
    }
    return depth;
  }

  // MuJoCo's collision of two boxes says half the depth where a face of one is touched (2.2.2: 2.5 mm for boxes that
  // overlap by 5 mm), and all of it between two edges. The normal of the former is that of the face.
  bool is_halved(const mjContact& contact) const {
    constexpr double kParallel = 1.0 - 1e-9;
    for (const int geom : {contact.geom1, contact.geom2}) {
      if (model->geom_type[geom] != mjGEOM_BOX) return false;
    }
    for (const int geom : {contact.geom1, contact.geom2}) {
      const mjtNum* R = data->geom_xmat + 9 * geom;
      for (int axis = 0; axis < 3; ++axis) {
        const double cosine = contact.frame[0] * R[axis] + contact.frame[1] * R[3 + axis] + contact.frame[2] * R[6 + axis];
        if (std::abs(cosine) > kParallel) return true;
      }
    }
    return false;
  }

  std::vector<std::pair<int, int>> touching() const {
    std::set<std::pair<int, int>> pairs;
    for (int i = 0; i < data->ncon; ++i) {
      // Body 0 is the world with the table; object i is body i + 1.
      const int a = model->geom_bodyid[data->contact[i].geom1] - 1, b = model->geom_bodyid[data->contact[i].geom2] - 1;
      pairs.emplace(std::min(a, b), std::max(a, b));
    }
    return {pairs.begin(), pairs.end()};
  }
};

Simulator::Simulator(std::vector<ObjectPtr> objects, const PhysicsOptions& options) : impl_(std::make_unique<Impl>()) {
  impl_->model = compile(mjcf_text(objects, {}, options));
  impl_->data.reset(mj_makeData(impl_->model.get()));
  if (!impl_->data) throw std::runtime_error("MuJoCo: no memory for the simulation");
  impl_->objects = std::move(objects);
  impl_->options = options;
}

Simulator::~Simulator() = default;
Simulator::Simulator(Simulator&&) noexcept = default;
Simulator& Simulator::operator=(Simulator&&) noexcept = default;
const std::vector<ObjectPtr>& Simulator::objects() const { return impl_->objects; }

SettleResult Simulator::settle(const std::vector<Pose>& T_world_object) const {
  return settle(T_world_object, 0.0, nullptr);
}

SettleResult Simulator::settle(const std::vector<Pose>& T_world_object, double frames_per_second,
                               std::vector<std::vector<Pose>>* frames) const {
  Impl& s = *impl_;
  if (T_world_object.size() != s.objects.size()) {
    throw std::invalid_argument("settle: " + std::to_string(T_world_object.size()) + " poses for " +
                                std::to_string(s.objects.size()) + " objects");
  }
  for (const Pose& pose : T_world_object) {
    if (!pose.matrix().allFinite()) throw std::invalid_argument("settle: a pose is not finite");
  }

  SettleResult result;
  s.start_at(T_world_object);
  result.initial_penetration = s.deepest_penetration();
  std::vector<mjtNum> anchor(s.data->qpos, s.data->qpos + s.model->nq);
  double rest_since = 0.0;
  result.status = SettleStatus::kTimeLimit;
  while (s.data->time < s.options.time_limit) {
    if (frames != nullptr && s.data->time * frames_per_second >= static_cast<double>(frames->size())) {
      frames->push_back(s.poses());
    }
    mj_step(s.model.get(), s.data.get());
    if (diverged(s.data.get())) {
      result.status = SettleStatus::kDiverged;
      break;
    }
    if (!s.near(anchor)) {
      anchor.assign(s.data->qpos, s.data->qpos + s.model->nq);
      rest_since = s.data->time;
    }
    if (s.data->time - rest_since >= s.options.rest_time) {
      result.status = SettleStatus::kSettled;
      break;
    }
  }
  result.seconds = s.data->time;
  if (result.status == SettleStatus::kDiverged) {
    result.T_world_object = T_world_object;
    return result;
  }
  result.T_world_object = s.poses();
  result.touching = s.touching();
  if (frames != nullptr) frames->push_back(result.T_world_object);
  return result;
}

struct SimulatorCache::Impl {
  PhysicsOptions options;
  std::size_t capacity = 1;
  using Key = std::vector<ObjectPtr>;  // holds the objects, so that an address is never reused while it is a key
  std::list<std::pair<Key, Simulator>> by_use;  // most recent first
  std::map<Key, std::list<std::pair<Key, Simulator>>::iterator> by_key;
};

SimulatorCache::SimulatorCache(const PhysicsOptions& options, std::size_t capacity) : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  impl_->capacity = std::max<std::size_t>(capacity, 1);
}

SimulatorCache::~SimulatorCache() = default;

const Simulator& SimulatorCache::get(const std::vector<ObjectPtr>& objects) {
  Impl& s = *impl_;
  const auto found = s.by_key.find(objects);
  if (found != s.by_key.end()) {
    s.by_use.splice(s.by_use.begin(), s.by_use, found->second);
    return found->second->second;
  }
  if (s.by_use.size() >= s.capacity) {
    s.by_key.erase(s.by_use.back().first);
    s.by_use.pop_back();
  }
  s.by_use.emplace_front(objects, Simulator(objects, s.options));
  s.by_key[objects] = s.by_use.begin();
  return s.by_use.front().second;
}

}  // namespace dofusion
