// The best poses of the library's objects for one more object of a scene.
#pragma once

#include <vector>

#include "perception/pose_hypotheses.h"

namespace dofusion {

// The same window seen coarsely and with lenient noise first, for the many guesses, and exactly at last.
struct ObservationPyramid {
  Observation coarse, medium, fine;
};

ObservationPyramid observe_pyramid(const DepthImage& depth, const Camera& camera, const Table& table,
                                   const LabelImage& labels, const PixelWindow& window, const DepthSigma& sigma,
                                   int coarse_stride);

struct PlacedObject {
  int model = 0;  // index into the models
  Pose T_world_object = Pose::Identity();
  Freedom freedom = Freedom::kFree;
};

// The scene that already stands, on every level.
struct PyramidScene {
  Explanation coarse, medium, fine;
};

PyramidScene explain(const ObservationPyramid& pyramid, const std::vector<ObjectModel>& models,
                     const std::vector<PlacedObject>& placed);

struct Candidate {
  PlacedObject placed;
  double gain = 0.0;  // by which it lowers the cost of the fine level
};

struct CandidateOptions {
  int threads = 1;
  int coarse_kept = 240;  // hypotheses that are aligned
  int medium_kept = 48;   // … and climbed
  int fine_kept = 12;     // … and returned at most
};

// Guesses from the target, scored coarsely; the best are aligned, climbed and scored exactly. The best first, no two
// alike. `heights`: level surfaces to rest on, metres.
std::vector<Candidate> find_candidates(const std::vector<ObjectModel>& models, const ObservationPyramid& pyramid,
                                       const PyramidScene& scene, const Target& target, const Camera& camera,
                                       const Pose& T_world_camera, const std::vector<double>& heights,
                                       const CandidateOptions& options);

// The same object in (nearly) the same place, its symmetries considered.
bool alike(const ObjectModel& model, const Pose& a, const Pose& b, double distance, double angle);

}  // namespace dofusion
