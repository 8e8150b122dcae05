#include "stability/physics.h"

#include <algorithm>
#include <list>
#include <map>
#include <stdexcept>

#include "stability/mjcf.h"
#include "stability/simulation.h"

namespace dofusion {
namespace {

std::vector<Simulation::Body> bodies_of(const std::vector<ObjectPtr>& objects) {
  std::vector<Simulation::Body> bodies;  // body 0 is the world with the table
  for (const ObjectPtr& object : objects) bodies.push_back({static_cast<int>(bodies.size()) + 1, object->diameter});
  return bodies;
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
  Simulation simulation;

  void start_at(const std::vector<Pose>& T_world_object) {
    if (T_world_object.size() != objects.size()) {
      throw std::invalid_argument("settle: " + std::to_string(T_world_object.size()) + " poses for " +
                                  std::to_string(objects.size()) + " objects");
    }
    for (const Pose& pose : T_world_object) {
      if (!pose.matrix().allFinite()) throw std::invalid_argument("settle: a pose is not finite");
    }
    simulation.start_at(T_world_object);
  }
};

Simulator::Simulator(std::vector<ObjectPtr> objects, const PhysicsOptions& options, std::vector<bool> fixed) {
  if (!fixed.empty() && fixed.size() != objects.size()) {
    throw std::invalid_argument("Simulator: `fixed` needs one entry per object");
  }
  MjcfOptions mjcf;
  mjcf.fixed = std::move(fixed);
  Simulation simulation(compile_mjcf(mjcf_text(objects, {}, options, mjcf)), bodies_of(objects));
  impl_.reset(new Impl{std::move(objects), options, std::move(simulation)});
}

Simulator::~Simulator() = default;
Simulator::Simulator(Simulator&&) noexcept = default;
Simulator& Simulator::operator=(Simulator&&) noexcept = default;
const std::vector<ObjectPtr>& Simulator::objects() const { return impl_->objects; }
const PhysicsOptions& Simulator::options() const { return impl_->options; }

SettleResult Simulator::settle(const std::vector<Pose>& T_world_object) const {
  return settle(T_world_object, 0.0, nullptr);
}

SettleResult Simulator::settle(const std::vector<Pose>& T_world_object, double frames_per_second,
                               std::vector<std::vector<Pose>>* frames) const {
  impl_->start_at(T_world_object);
  return impl_->simulation.settle(impl_->options, {}, {impl_->options.time_limit, true}, {frames_per_second, frames});
}

SettleResult Simulator::run(const std::vector<Pose>& T_world_object, const Loads& loads,
                            const RunLimits& limits) const {
  if (!loads.forces.empty() && loads.forces.size() != impl_->objects.size()) {
    throw std::invalid_argument("run: loads need one force per object");
  }
  impl_->start_at(T_world_object);
  return impl_->simulation.settle(impl_->options, loads, limits, {});
}

struct SimulatorCache::Impl {
  PhysicsOptions options;
  std::size_t capacity = 1;
  using Key = std::pair<std::vector<ObjectPtr>, std::vector<bool>>;  // holds the objects, so that an address is never reused while it is a key
  std::list<std::pair<Key, Simulator>> by_use;  // most recent first
  std::map<Key, std::list<std::pair<Key, Simulator>>::iterator> by_key;
};

SimulatorCache::SimulatorCache(const PhysicsOptions& options, std::size_t capacity) : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  impl_->capacity = std::max<std::size_t>(capacity, 1);
}

SimulatorCache::~SimulatorCache() = default;

const Simulator& SimulatorCache::get(const std::vector<ObjectPtr>& objects, const std::vector<bool>& fixed) {
  Impl& s = *impl_;
  const Impl::Key key(objects, fixed);
  const auto found = s.by_key.find(key);
  if (found != s.by_key.end()) {
    s.by_use.splice(s.by_use.begin(), s.by_use, found->second);
    return found->second->second;
  }
  if (s.by_use.size() >= s.capacity) {
    s.by_key.erase(s.by_use.back().first);
    s.by_use.pop_back();
  }
  s.by_use.emplace_front(key, Simulator(objects, s.options, fixed));
  s.by_key[key] = s.by_use.begin();
  return s.by_use.front().second;
}

}  // namespace dofusion
