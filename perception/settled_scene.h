// Scenes as physics leaves them.
#pragma once

#include <vector>

#include "perception/scene_score.h"

namespace dofusion {

struct SettleLimits {
  double distance = 0.0;  // metres, and
  double angle = 0.0;     // radians that an object may move and still be what was seen
};

// Settles the scenes (best first) and takes the one with the best score among them, those that fall over handicapped.
// Its objects have their settled poses if these explain the image about as well, else the seen ones.
SceneHypothesis choose_settled(const std::vector<ObjectModel>& models, const Cluster& cluster,
                               const std::vector<SceneHypothesis>& scenes, const SceneCosts& costs,
                               const SettleLimits& limits);

}  // namespace dofusion
