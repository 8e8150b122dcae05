#include "stability/simulation.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace dofusion {
namespace {

constexpr mjtNum kTouchingGap = 1e-4;  // metres: what lies side by side may part by micrometres

}  // namespace

// Tells since when every body has stayed near one pose.
struct Simulation::RestWatch {
  RestWatch(const PhysicsOptions& options, const std::vector<Body>& bodies)
      : cosine(std::cos(0.5 * options.rest_turn)), time(options.rest_time) {
    for (const Body& body : bodies) shifts.push_back(options.rest_shift * body.diameter);
  }

  // True once all bodies have rested for long enough.
  bool rests(const mjData& data, const std::vector<Body>& bodies) {
    if (anchor.empty() || !near(data, bodies)) {
      anchor.clear();
      for (const Body& body : bodies) {
        anchor.insert(anchor.end(), data.xipos + 3 * body.id, data.xipos + 3 * body.id + 3);
        anchor.insert(anchor.end(), data.xquat + 4 * body.id, data.xquat + 4 * body.id + 4);
      }
      since = data.time;
    }
    return data.time - since >= time;
  }

  bool near(const mjData& data, const std::vector<Body>& bodies) const {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const mjtNum *position = data.xipos + 3 * bodies[i].id, *turn = data.xquat + 4 * bodies[i].id;
      if (mju_dist3(position, &anchor[7 * i]) > shifts[i]) return false;
      // The product of two unit quaternions is the cosine of half the angle between them.
      if (std::abs(mju_dot(turn, &anchor[7 * i + 3], 4)) < cosine) return false;
    }
    return true;
  }

  double cosine, time;
  std::vector<double> shifts;
  std::vector<mjtNum> anchor;  // 7 numbers a body
  double since = 0.0;
};

Simulation::Simulation(ModelPtr model, std::vector<Body> bodies)
    : model_(std::move(model)), data_(make_data(*model_)), bodies_(std::move(bodies)) {
  reset();
}

void Simulation::reset(int keyframe) {
  mj_resetDataKeyframe(model_.get(), data_.get(), keyframe);
  data_->time = 0.0;  // a keyframe has its own
}

void Simulation::start_at(const std::vector<Pose>& T_world_body) {
  mj_resetData(model_.get(), data_.get());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const PoseArray pose = to_array(T_world_body[i]);
    const int mocap = model_->body_mocapid[bodies_[i].id];
    if (mocap >= 0) {
      std::copy_n(pose.begin(), 3, data_->mocap_pos + 3 * mocap);
      std::copy_n(pose.begin() + 3, 4, data_->mocap_quat + 4 * mocap);
    } else {
      std::copy(pose.begin(), pose.end(), data_->qpos + model_->jnt_qposadr[model_->body_jntadr[bodies_[i].id]]);
    }
  }
}

std::vector<Pose> Simulation::poses() {
  mj_kinematics(model_.get(), data_.get());  // mj_step leaves positions of the step's beginning
  std::vector<Pose> result;
  for (const Body& body : bodies_) {
    PoseArray pose;
    std::copy_n(data_->xipos + 3 * body.id, 3, pose.begin());
    std::copy_n(data_->xquat + 4 * body.id, 4, pose.begin() + 3);
    result.push_back(from_array(pose));
  }
  return result;
}

void Simulation::place_cameras() {
  mj_kinematics(model_.get(), data_.get());
  mj_comPos(model_.get(), data_.get());  // what cameras may track
  mj_camlight(model_.get(), data_.get());
}

void Simulation::apply(const Loads& loads) {
  mju_copy3(model_->opt.gravity, loads.gravity.data());
  for (std::size_t i = 0; i < loads.forces.size(); ++i) {
    mju_copy3(data_->xfrc_applied + 6 * bodies_[i].id, loads.forces[i].data());
  }
}

SettleResult Simulation::settle(const PhysicsOptions& options, const Loads& loads, const RunLimits& limits,
                                const Recording& recording) {
  SettleResult result;
  result.turned.assign(bodies_.size(), 0.0);
  result.T_world_object = poses();
  result.status = SettleStatus::kTimeLimit;
  apply(loads);
  bool pushed_for_a_while = !loads.forces.empty() && std::isfinite(loads.forces_until);
  RestWatch watch(options, bodies_);
  const double last_start = limits.seconds - model_->opt.timestep / 2.0;
  for (bool first = true; data_->time < last_start; first = false) {
    if (limits.stop && limits.stop()) break;
    record(recording);
    if (pushed_for_a_while && data_->time >= loads.forces_until) {
      mju_zero(data_->xfrc_applied, 6 * model_->nbody);
      pushed_for_a_while = false;
    }
    step(*model_, *data_);
    if (has_diverged(*data_)) {
      result.status = SettleStatus::kDiverged;
      break;
    }
    if (first) result.initial_penetration = deepest_penetration();  // the contacts are those of the step's beginning
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      result.turned[i] += mju_norm3(data_->cvel + 6 * bodies_[i].id) * model_->opt.timestep;
    }
    if (limits.until_rest && !pushed_for_a_while && watch.rests(*data_, bodies_)) {
      result.status = SettleStatus::kSettled;
      break;
    }
  }
  result.seconds = data_->time;
  if (result.status == SettleStatus::kDiverged) return result;
  result.T_world_object = poses();
  result.touching = touching();
  if (recording.frames != nullptr) recording.frames->push_back(result.T_world_object);
  return result;
}

void Simulation::record(const Recording& recording) {
  if (recording.frames == nullptr) return;
  if (data_->time * recording.frames_per_second < static_cast<double>(recording.frames->size())) return;
  // Kinematics normalises quaternions in place: a motion that is looked at would differ in the last digit.
  const std::vector<mjtNum> qpos(data_->qpos, data_->qpos + model_->nq);
  recording.frames->push_back(poses());
  std::copy(qpos.begin(), qpos.end(), data_->qpos);
}

// Collision once more, for surfaces up to kTouchingGap apart as well.
void Simulation::find_near_contacts() {
  struct WiderMargins {
    explicit WiderMargins(mjModel& m) : model(m), own(m.geom_margin, m.geom_margin + m.ngeom) {
      for (int g = 0; g < m.ngeom; ++g) m.geom_margin[g] = std::max(m.geom_margin[g], kTouchingGap);
    }
    ~WiderMargins() { std::copy(own.begin(), own.end(), model.geom_margin); }
    mjModel& model;
    std::vector<mjtNum> own;
  } margins(*model_);
  mj_kinematics(model_.get(), data_.get());
  collide(*model_, *data_);
}

double Simulation::deepest_penetration() const {
  double depth = 0.0;
  for (int i = 0; i < data_->ncon; ++i) {
    depth = std::max(depth, -data_->contact[i].dist);
  }
  return depth;
}

std::vector<std::pair<int, int>> Simulation::touching() {
  find_near_contacts();
  // Bodies that do not count are part of the surroundings, as the table is: -1.
  std::vector<int> index(static_cast<std::size_t>(model_->nbody), -1);
  for (std::size_t i = 0; i < bodies_.size(); ++i) index[static_cast<std::size_t>(bodies_[i].id)] = static_cast<int>(i);
  std::set<std::pair<int, int>> pairs;
  for (int i = 0; i < data_->ncon; ++i) {
    const int a = index[static_cast<std::size_t>(model_->geom_bodyid[data_->contact[i].geom1])];
    const int b = index[static_cast<std::size_t>(model_->geom_bodyid[data_->contact[i].geom2])];
    if (a != b) pairs.emplace(std::min(a, b), std::max(a, b));
  }
  return {pairs.begin(), pairs.end()};
}

}  // namespace dofusion
