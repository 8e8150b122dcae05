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
  int attempts = 0;  // starts that were settled
};

// The scene nearest to the recovered one that stands: overlaps are pushed apart and objects lifted off the table by
// what they overlap, then everything settles. If that diverges or moves anything by more than 5 % or 5 degrees, it is
// settled again as recovered and from small lifts (1 and 3 mm from object to object), and what comes to rest with the
// least motion is taken. Displacements count from the given poses. A scene without objects settles as it is.
PlausibleScene make_plausible(const Scene& recovered, const PhysicsOptions& options = {});

}  // namespace dofusion
