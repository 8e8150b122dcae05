// How well several objects together explain a cluster, and the poses at which they do so best.
#pragma once

#include <vector>

#include "perception/unexplained.h"

namespace dofusion {

// In nats, the unit of the pixels' costs, or the sigmas that turn metres into nats.
struct SceneCosts {
  double object = 100.0;        // of every object
  double resting_bonus = 15.0;  // what an object may lose by resting flat and still be taken to
  double penetration = 0.0005;  // metres that objects may overlap by, one sigma
  double floating = 0.001;      // metres between an object and what it should rest on, one sigma
};

struct SceneHypothesis {
  std::vector<PlacedObject> objects;
  double score = 0.0;  // minus all costs, of pixels, objects, overlaps and gaps
};

// The score of a scene; `complete` scenes are charged for objects that hang in the air, too.
double scene_score(const std::vector<ObjectModel>& models, const Cluster& cluster,
                   const std::vector<PlacedObject>& objects, bool complete, const SceneCosts& costs);

// Every object in turn aligned and climbed while the others stay, twice; those that lie nearly flat are laid flat if
// that explains the image about as well.
SceneHypothesis refine_jointly(const std::vector<ObjectModel>& models, const Cluster& cluster,
                               const SceneHypothesis& scene, const SceneCosts& costs);

// All objects but the i-th.
std::vector<PlacedObject> without(std::vector<PlacedObject> objects, std::size_t i);

}  // namespace dofusion
