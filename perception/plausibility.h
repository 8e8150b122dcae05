// Recovered scenes as physics would have them.
#pragma once

#include "stability/metrics.h"
#include "stability/physics.h"

namespace dofusion {

struct PlausibleScene {
  Scene scene;             // settled, or as given if the simulation diverged
  double moved_pct = 0.0;  // the largest translation from the given pose, per cent of the diameter
  double moved_deg = 0.0;  // the largest rotation
  SettleStatus status = SettleStatus::kDiverged;
};

// The scene nearest to the recovered one that stands: overlaps are pushed apart and objects lifted off the table by
// what they overlap, then everything settles. Displacements count from the given poses. A scene without objects
// settles as it is.
PlausibleScene make_plausible(const Scene& recovered, const PhysicsOptions& options = {});

}  // namespace dofusion
