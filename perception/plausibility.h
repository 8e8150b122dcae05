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
  int attempts = 0;  // simulations that it took: 1 where nothing had to be tried
};

// A scene that stands, as near to the recovered one as was found: overlaps (of convex solids, or of the convex parts of
// others) are pushed apart and objects lifted off the table by what they overlap, then everything settles. Where that
// diverges or something topples, the objects that topple, and those that they lie on, are tried at places up to 15 % of
// their diameter aside and a hair higher, twice over; the scene that ends nearest to the given one is taken, nearness
// being the larger of translation / 10 % and rotation / 10 degrees over all objects (what stability is judged by). At
// most about 100 simulations. Displacements count from the given poses. A scene without objects stands as it is.
PlausibleScene make_plausible(const Scene& recovered, const PhysicsOptions& options = {});

// What `make_plausible` makes small: 1 is the limit of a stable scene.
double motion(const Displacement& displacement);

}  // namespace dofusion
