// Which candidate to try first: the one that most probably stands, whatever recovery got wrong.
#pragma once

#include <cstdint>
#include <vector>

#include "apps/placement.h"
#include "apps/uncertainty.h"

namespace dofusion {

struct RankingOptions {
  int screening = 5;    // drawn scenes that every candidate is settled in
  int finalists = 5;    // candidates that go on to
  int more = 15;        // further drawn scenes
  double time_limit = 1.5;  // simulated seconds within which a drawn scene must come to rest
  std::uint64_t seed = 0;
  int threads = 1;
};

// Settles the stable `placements` that meet all wishes in scenes that the sampler draws, the query put down a little
// off, and sets their `stable_probability`: (s + 1) / (n + 2) of n scenes of which s stood, the expected probability after such a trial
// (Laplace's rule of succession), so that few trials never promise certainty. Sorts them: those first, by that
// and then by how much moved in the mean over the drawn scenes; then the other stable ones, then the rest, as they were. The same arguments give the same
// result on any number of threads. Throws std::invalid_argument if the counts are negative.
void rank_by_probability(const SceneSampler& sampler, const ObjectPtr& query, const RankingOptions& options,
                         std::vector<Placement>& placements);

}  // namespace dofusion
