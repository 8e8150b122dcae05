#include "apps/placement.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <numeric>

#include "stability/parallel_for.h"

namespace dofusion {
namespace {

// One thread's simulator of the scene with the query.
class Checker {
 public:
  Checker(const Scene& scene, const ObjectPtr& query, const PhysicsOptions& physics)
      : objects_(with(scene.objects, query)), context_(scene.T_world_object), simulator_(objects_, physics) {}

  Placement check(const Pose& T_world_query) const {
    Placement placement;
    placement.T_world_query = placement.T_world_sampled = T_world_query;
    std::vector<Pose> start = context_;
    start.push_back(T_world_query);
    const SettleResult settled = simulator_.settle(start);
    placement.status = settled.status;
    placement.penetration = settled.initial_penetration;
    placement.settled = settled.T_world_object;
    const int query = static_cast<int>(objects_.size()) - 1;
    for (const auto& [a, b] : settled.touching) {
      if (b == query) placement.touches.push_back(a);  // pairs are in order, and the query is last
    }
    if (settled.status == SettleStatus::kDiverged) {
      const double inf = std::numeric_limits<double>::infinity();
      placement.displacement = {inf, inf};
      return placement;
    }
    placement.displacement = displacement(objects_, start, settled.T_world_object);
    placement.stable = settled.status == SettleStatus::kSettled && is_stable(placement.displacement);
    return placement;
  }

 private:
  static std::vector<ObjectPtr> with(std::vector<ObjectPtr> objects, const ObjectPtr& query) {
    objects.push_back(query);
    return objects;
  }
  std::vector<ObjectPtr> objects_;
  std::vector<Pose> context_;
  Simulator simulator_;
};

// How much moved, as one number: 1 is the limit of stability.
double movement(const Placement& p) {
  return std::max(p.displacement.translation_pct / kStableTranslationPct,
                  p.displacement.rotation_deg / kStableRotationDeg);
}

bool moves_less(const Placement& a, const Placement& b) {
  if (a.stable != b.stable) return a.stable;
  return movement(a) < movement(b);
}

bool ranks_before(const Placement& a, const Placement& b) {
  if (a.stable != b.stable) return a.stable;
  const double robust_a = a.robustness.value_or(0.0), robust_b = b.robustness.value_or(0.0);
  if (robust_a != robust_b) return robust_a > robust_b;
  return movement(a) < movement(b);
}

Pose disturbed(const Pose& pose, const PlacementOptions& options, Rng& rng) {
  Pose result = pose;
  result.translation() += normal3(rng, options.trial_shift);
  result.linear() = so3_exp(normal3(rng, options.trial_turn)) * pose.linear();
  return result;
}

// The anchor and the objects nearest to it, surface to surface by bounding spheres.
Scene local_scene(const Scene& scene, std::size_t anchor, std::size_t count) {
  std::vector<std::size_t> order(scene.objects.size());
  std::iota(order.begin(), order.end(), 0);
  const auto gap = [&](std::size_t i) {
    if (i == anchor) return -std::numeric_limits<double>::infinity();
    const double centres = (scene.T_world_object[i].translation() - scene.T_world_object[anchor].translation()).norm();
    return centres - 0.5 * (scene.objects[i]->diameter + scene.objects[anchor]->diameter);
  };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return gap(a) < gap(b); });
  Scene local;
  for (std::size_t k = 0; k < count; ++k) {
    local.objects.push_back(scene.objects[order[k]]);
    local.T_world_object.push_back(scene.T_world_object[order[k]]);
  }
  return local;
}

}  // namespace

std::vector<PlacementProblem> placement_problems(const Scene& scene, const ObjectPtr& query,
                                                 const PlacementOptions& options) {
  const std::size_t n = scene.objects.size();
  std::vector<PlacementProblem> problems;
  for (int i = 0; i < options.samples; ++i) {
    PlacementProblem problem;
    problem.query = query;
    problem.seed = make_rng(options.seed, static_cast<std::uint64_t>(i))();
    const bool whole = n <= static_cast<std::size_t>(options.context);
    const std::size_t anchor = options.anchor.value_or(static_cast<std::size_t>(i) % std::max<std::size_t>(n, 1));
    problem.context = whole ? scene : local_scene(scene, anchor, static_cast<std::size_t>(options.context));
    problem.centre = options.centre.value_or(default_centre(problem.context));
    problem.start = options.start;
    problem.guides = options.guides;
    problems.push_back(std::move(problem));
  }
  return problems;
}

SamplerOptions sampler_options(const PlacementOptions& options) {
  SamplerOptions sampler;
  sampler.steps = options.steps;
  sampler.threads = options.threads;
  sampler.start_sigma = options.start_sigma;
  return sampler;
}

std::vector<Placement> check_placements(const Scene& scene, const ObjectPtr& query, const std::vector<Pose>& candidates,
                                        const PlacementOptions& options) {
  std::vector<std::unique_ptr<Checker>> checkers;
  const int threads = std::max(1, std::min(options.threads, static_cast<int>(candidates.size())));
  for (int t = 0; t < threads; ++t) {
    checkers.push_back(std::make_unique<Checker>(scene, query, options.physics));
  }
  std::vector<Placement> placements(candidates.size());
  parallel_for(static_cast<std::int64_t>(candidates.size()), threads, [&](std::int64_t i, int thread) {
    const Checker& checker = *checkers[static_cast<std::size_t>(thread)];
    Placement& placement = placements[static_cast<std::size_t>(i)];
    placement = checker.check(candidates[static_cast<std::size_t>(i)]);
    if (!options.polish || !placement.stable) return;
    Placement polished = checker.check(placement.settled.back());
    polished.T_world_sampled = placement.T_world_sampled;
    if (moves_less(polished, placement)) placement = polished;
  });

  std::stable_sort(placements.begin(), placements.end(), moves_less);
  const std::size_t tried = std::min(placements.size(), static_cast<std::size_t>(std::max(options.tried, 0)));
  parallel_for(static_cast<std::int64_t>(tried), threads, [&](std::int64_t i, int thread) {
    Placement& placement = placements[static_cast<std::size_t>(i)];
    if (!placement.stable || options.trials <= 0) return;
    Rng rng = make_rng(options.seed ^ 0x7261696c73ull, static_cast<std::uint64_t>(i));
    int stood = 0;
    for (int k = 0; k < options.trials; ++k) {
      const Pose pose = disturbed(placement.T_world_query, options, rng);
      stood += checkers[static_cast<std::size_t>(thread)]->check(pose).stable ? 1 : 0;
    }
    placement.robustness = static_cast<double>(stood) / options.trials;
  });
  std::stable_sort(placements.begin(), placements.end(), ranks_before);
  return placements;
}

std::vector<Placement> place(const Scene& scene, const ObjectPtr& query, const PlacementModel& model,
                             const PlacementOptions& options) {
  const std::vector<Pose> candidates =
      model.sample(placement_problems(scene, query, options), sampler_options(options));
  return check_placements(scene, query, candidates, options);
}

}  // namespace dofusion
