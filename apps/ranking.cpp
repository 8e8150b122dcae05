#include "apps/ranking.h"

#include <algorithm>
#include <stdexcept>

#include "stability/parallel_for.h"
#include "stability/random.h"

namespace dofusion {
namespace {

// Of one candidate over the drawn scenes.
struct Tally {
  int stood = 0, tried = 0;
  double movement = 0.0;  // sum of min(1, movement), 1 being the limit of stability

  double probability() const { return (stood + 1.0) / (tried + 2.0); }
  double mean_movement() const { return tried > 0 ? movement / tried : 1.0; }
};

struct Verdict {
  bool stood = false;
  double movement = 1.0;
};

Pose put_down(const Pose& pose, const RecoveryUncertainty& sigma, Rng& rng) {
  const Eigen::Vector3d shift = normal3(rng, sigma.query_shift), turn = normal3(rng, sigma.query_turn);
  return make_pose(so3_exp(turn) * pose.linear(), pose.translation() + shift);
}

// The candidates in one drawn scene.
std::vector<Verdict> settle_in(const DrawnScene& drawn, const ObjectPtr& query, const std::vector<Pose>& candidates,
                               const RecoveryUncertainty& sigma, double time_limit, Rng rng) {
  PhysicsOptions physics = drawn.physics;
  physics.time_limit = time_limit;
  std::vector<ObjectPtr> objects = drawn.scene.objects;
  objects.push_back(query);
  const Simulator simulator(objects, physics);
  std::vector<Verdict> verdicts;
  for (const Pose& candidate : candidates) {
    std::vector<Pose> start = drawn.scene.T_world_object;
    start.push_back(put_down(drawn.T_drawn_recovered * candidate, sigma, rng));
    const SettleResult settled = simulator.settle(start);
    Verdict verdict;
    if (settled.status == SettleStatus::kSettled) {
      const Displacement moved = displacement(objects, start, settled.T_world_object);
      verdict.stood = is_stable(moved);
      verdict.movement = std::min(1.0, std::max(moved.translation_pct / kStableTranslationPct,
                                                moved.rotation_deg / kStableRotationDeg));
    }
    verdicts.push_back(verdict);
  }
  return verdicts;
}

// Adds the drawn scenes first … first + count - 1 to the tallies of the chosen candidates.
void try_in(const SceneSampler& sampler, const ObjectPtr& query, const RankingOptions& options, int first, int count,
            const std::vector<Placement>& placements, const std::vector<std::size_t>& chosen,
            std::vector<Tally>& tallies) {
  if (chosen.empty()) return;
  std::vector<Pose> candidates;
  for (const std::size_t i : chosen) candidates.push_back(placements[i].T_world_query);
  std::vector<std::vector<Verdict>> verdicts(static_cast<std::size_t>(count));
  parallel_for(count, options.threads, [&](std::int64_t k, int) {
    const int index = first + static_cast<int>(k);
    verdicts[static_cast<std::size_t>(k)] =
        settle_in(sampler.draw(index), query, candidates, sampler.uncertainty(), options.time_limit,
                  make_rng(options.seed ^ 0x70757420646f776eull, static_cast<std::uint64_t>(index)));
  });
  for (const std::vector<Verdict>& scene : verdicts) {
    for (std::size_t c = 0; c < chosen.size(); ++c) {
      Tally& tally = tallies[chosen[c]];
      ++tally.tried;
      tally.stood += scene[c].stood ? 1 : 0;
      tally.movement += scene[c].movement;
    }
  }
}

}  // namespace

void rank_by_probability(const SceneSampler& sampler, const ObjectPtr& query, const RankingOptions& options,
                         std::vector<Placement>& placements) {
  if (options.screening < 0 || options.finalists < 0 || options.more < 0)
    throw std::invalid_argument("rank_by_probability: counts must not be negative");
  std::vector<Tally> tallies(placements.size());
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < placements.size(); ++i) order.push_back(i);
  const auto ranks_before = [&](std::size_t a, std::size_t b) {
    if (placements[a].stable != placements[b].stable) return placements[a].stable;
    if (!placements[a].stable) return false;
    if (placements[a].unmet.empty() != placements[b].unmet.empty()) return placements[a].unmet.empty();
    const double p_a = tallies[a].probability(), p_b = tallies[b].probability();
    return p_a != p_b ? p_a > p_b : tallies[a].mean_movement() < tallies[b].mean_movement();
  };

  std::vector<std::size_t> chosen;
  for (const std::size_t i : order) {
    if (placements[i].stable && placements[i].unmet.empty()) chosen.push_back(i);
  }
  try_in(sampler, query, options, 0, options.screening, placements, chosen, tallies);
  std::stable_sort(chosen.begin(), chosen.end(), ranks_before);
  if (chosen.size() > static_cast<std::size_t>(options.finalists)) chosen.resize(static_cast<std::size_t>(options.finalists));
  try_in(sampler, query, options, options.screening, options.more, placements, chosen, tallies);

  std::stable_sort(order.begin(), order.end(), ranks_before);
  std::vector<Placement> ranked;
  for (const std::size_t i : order) {
    ranked.push_back(std::move(placements[i]));
    if (tallies[i].tried > 0) ranked.back().stable_probability = tallies[i].probability();
  }
  placements = std::move(ranked);
}

}  // namespace dofusion
