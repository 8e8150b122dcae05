#include "apps/settling_motion.h"

#include <algorithm>
#include <memory>

#include "stability/parallel_for.h"

namespace dofusion {
namespace {

bool within(const std::vector<Pose>& poses, double reach) {
  return std::all_of(poses.begin(), poses.end(),
                     [&](const Pose& pose) { return pose.matrix().allFinite() && pose.translation().norm() <= reach; });
}

// The frames' times: regular ones, but the last is where the simulation ended.
SettlingMotion timed(std::vector<std::vector<Pose>> frames, const SettleResult& result, const MotionOptions& options) {
  SettlingMotion motion;
  const bool ended = result.status != SettleStatus::kDiverged;  // then the end is a frame as well
  for (std::size_t k = 0; k < frames.size(); ++k) {
    if (k > 0 && !within(frames[k], options.reach)) break;
    const bool last = ended && k > 0 && k + 1 == frames.size();
    motion.seconds.push_back(last ? result.seconds : static_cast<double>(k) / options.frames_per_second);
    motion.T_world_object.push_back(std::move(frames[k]));
  }
  return motion;
}

}  // namespace

std::vector<SettlingMotion> settling_motions(const Scene& scene, const ObjectPtr& query,
                                             const std::vector<Placement>& placements, const PhysicsOptions& physics,
                                             int threads, const MotionOptions& options) {
  std::vector<ObjectPtr> objects = scene.objects;
  objects.push_back(query);
  const std::size_t simulated = std::min(options.most, placements.size());
  std::vector<std::unique_ptr<Simulator>> simulators;
  threads = std::max(1, std::min(threads, static_cast<int>(simulated)));
  if (simulated > 0) {
    for (int t = 0; t < threads; ++t) simulators.push_back(std::make_unique<Simulator>(objects, physics));
  }
  std::vector<SettlingMotion> motions(placements.size());
  parallel_for(static_cast<std::int64_t>(placements.size()), threads, [&](std::int64_t i, int thread) {
    const std::size_t k = static_cast<std::size_t>(i);
    std::vector<Pose> start = scene.T_world_object;
    start.push_back(placements[k].T_world_query);
    if (k >= simulated) {
      motions[k] = {{0.0}, {start}};
      return;
    }
    std::vector<std::vector<Pose>> frames;
    const SettleResult result =
        simulators[static_cast<std::size_t>(thread)]->settle(start, options.frames_per_second, &frames);
    motions[k] = timed(std::move(frames), result, options);
  });
  return motions;
}

}  // namespace dofusion
