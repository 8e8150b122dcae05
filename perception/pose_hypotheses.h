// Where an object of the library might be, from what is seen of it: many guesses, the right one among them.
#pragma once

#include <vector>

#include "perception/faces.h"
#include "perception/object_model.h"
#include "perception/pose_refinement.h"
#include "perception/pose_score.h"

namespace dofusion {

// A flat part of what is seen, in the world.
struct SeenFace {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // unit, towards the camera
  double offset = 0.0;                                // metres; n·p of the plane
  std::vector<Eigen::Vector3d> points;                // readings on it (thinned out), metres
};

// Pixels that one more object is sought for.
struct Target {
  std::vector<SeenFace> faces;                         // the largest first
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  // of the readings, world, metres
  Eigen::Vector2d min_px = Eigen::Vector2d::Zero();    // bounding box in the image, robust against stray pixels
  Eigen::Vector2d max_px = Eigen::Vector2d::Zero();
  int pixels = 0;
};

// `pixels` are indices into the image. `face_map` comes from find_faces on the same image.
Target make_target(const std::vector<int>& pixels, const DepthImage& depth, const Camera& camera,
                   const Pose& T_world_camera, const FaceMap& face_map);

struct PoseHypothesis {
  int model = 0;  // index into the models
  Pose T_world_object = Pose::Identity();
  Freedom freedom = Freedom::kFree;
};

struct HypothesisOptions {
  double turn_step = 0.26;    // radians between turns about a normal
  double angle_match = 0.21;  // radians by which the angle between two seen faces may differ from the object's
  double same_place = 0.004;  // metres; places nearer to each other are one guess
};

// Every object on every rest face at every yaw, on surfaces at the given heights (metres), placed so that its outline
// and the target's meet in the centre or in one of the bounding box's corners.
void add_resting_hypotheses(const std::vector<ObjectModel>& models, const Target& target, const Camera& camera,
                            const Pose& T_world_camera, const std::vector<double>& heights,
                            const HypothesisOptions& options, std::vector<PoseHypothesis>& hypotheses);

// Every face of every object put into every seen face's plane at every turn, centred or corner to corner.
void add_face_hypotheses(const std::vector<ObjectModel>& models, const Target& target, const HypothesisOptions& options,
                         std::vector<PoseHypothesis>& hypotheses);

// Every pair of an object's faces that includes the same angle as a pair of seen faces: that fixes the rotation and
// all but one coordinate of the position.
void add_face_pair_hypotheses(const std::vector<ObjectModel>& models, const Target& target,
                              const HypothesisOptions& options, std::vector<PoseHypothesis>& hypotheses);

}  // namespace dofusion
