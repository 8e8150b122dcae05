// The best poses of the library's objects for one more object of a scene.
#pragma once

#include <vector>

#include "perception/contact_costs.h"
#include "perception/pose_hypotheses.h"

namespace dofusion {

// The same window seen coarsely and with lenient noise first, for the many guesses, and exactly at last.
struct ObservationPyramid {
  std::vector<Observation> coarse, medium, fine;  // one for each view
};

// Adds what one more camera saw. Pixels with `ignored` labels say nothing.
void add_view(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
              const PixelWindow& window, const DepthSigma& sigma, int coarse_stride,
              const std::vector<std::uint8_t>& ignored, ObservationPyramid& pyramid);

// The scene that already stands, as every level explains it.
struct PyramidScene {
  std::vector<PlacedObject> objects;
  Explanation coarse, medium, fine;
};

PyramidScene explain(const ObservationPyramid& pyramid, const std::vector<ObjectModel>& models,
                     const std::vector<PlacedObject>& placed);

struct Candidate {
  PlacedObject placed;
  double gain = 0.0;  // by which it lowers the cost of the fine level, less what it overlaps
};

struct CandidateOptions {
  int threads = 1;
  int coarse_kept = 240;        // hypotheses that are aligned
  int medium_kept = 48;         // … and climbed
  int fine_kept = 12;           // … and returned; more if objects would be missing
  double penetration = 0.0005;  // metres, one sigma; on the coarser levels more
};

// Guesses from the target, scored coarsely; the best are aligned, climbed and scored exactly. The best first, no two
// alike, and the best of every object among them.
std::vector<Candidate> find_candidates(const std::vector<ObjectModel>& models, const ObservationPyramid& pyramid,
                                       const PyramidScene& scene, const Target& target, const Camera& camera,
                                       const Pose& T_world_camera, const CandidateOptions& options);

// The same object in (nearly) the same place, its symmetries considered.
bool alike(const ObjectModel& model, const Pose& a, const Pose& b, double distance, double angle);

}  // namespace dofusion
