// From a roughly right pose to the best one.
#pragma once

#include <functional>

#include "perception/pose_score.h"

namespace dofusion {

// What a pose may change. Resting objects slide and turn on their support and keep their height and tilt.
enum class Freedom { kFree, kResting };

struct AlignOptions {
  int iterations = 4;
  double first_gate = 0.015;  // metres; readings farther from the rendered surface are not its own …
  double last_gate = 0.005;   // … and the gate closes to this, geometrically
};

// Point-to-plane alignment: each iteration renders the object, pairs every pixel's reading with the rendered surface
// along its ray, and takes one damped Gauss-Newton step on the differences in depth, weighted by the noise. Moves an
// object along what its visible faces fix; sliding within a face's plane is left to climb().
Pose align_to_readings(PoseScorer& scorer, const Explanation& scene, const TriangleMesh& mesh, const Pose& start,
                       Freedom freedom, const AlignOptions& options = {});

struct ClimbOptions {
  double first_step = 0.004;   // metres; rotations step so that the object's rim moves as far
  double last_step = 0.00025;  // metres
  int rounds_per_step = 3;
};

using PoseObjective = std::function<double(const Pose&)>;  // larger is better

struct ScoredPose {
  Pose T_world_object = Pose::Identity();
  double score = 0.0;
};

// Coordinate search with halving steps for what has no derivative: outlines, free space, contact. `start` has the score
// that the objective gives it; `radius` (metres) is the distance from the object's origin to its rim. The objective is
// expensive: with one step no pose is asked for twice in a row of failures, nor the one that was just left.
ScoredPose climb(const PoseObjective& objective, const ScoredPose& start, Freedom freedom, double radius,
                 const ClimbOptions& options = {});

// The pose moved by a translation (world) and turned about its own origin by a world-frame rotation vector.
Pose moved(const Pose& T_world_object, const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation);

}  // namespace dofusion
