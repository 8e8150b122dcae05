#include "perception/candidate_search.h"

#include <algorithm>
#include <cmath>

#include "stability/parallel_for.h"

namespace dofusion {
namespace {

constexpr double kAlikeDistance = 0.003;  // metres
constexpr double kAlikeAngle = 0.08;      // radians

void sort_by_gain(std::vector<Candidate>& candidates) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.gain > b.gain; });
}

// The `count` best, no two alike, and the best `per_model` of every object even if they are not among them: what
// looks worse while it is roughly placed may be the right one.
std::vector<Candidate> best_distinct(std::vector<Candidate> candidates, const std::vector<ObjectModel>& models,
                                     int count, int per_model) {
  sort_by_gain(candidates);
  std::vector<Candidate> kept;
  std::vector<int> kept_of(models.size(), 0);
  for (const Candidate& candidate : candidates) {
    const int model = candidate.placed.model;
    if (static_cast<int>(kept.size()) >= count && kept_of[model] >= per_model) continue;
    const bool seen = std::any_of(kept.begin(), kept.end(), [&](const Candidate& other) {
      return other.placed.model == model && other.placed.freedom == candidate.placed.freedom &&
             alike(models[model], other.placed.T_world_object, candidate.placed.T_world_object, kAlikeDistance,
                   kAlikeAngle);
    });
    if (seen) continue;
    kept.push_back(candidate);
    ++kept_of[model];
  }
  return kept;
}

// One level of the pyramid with a scorer for each thread.
class Level {
 public:
  Level(const std::vector<ObjectModel>& models, const std::vector<Observation>& observations,
        const Explanation& explanation, const std::vector<PlacedObject>& objects, double penetration, int threads)
      : models_(models), explanation_(explanation), objects_(objects), penetration_(penetration) {
    for (int i = 0; i < threads; ++i) scorers_.emplace_back(observations);
  }

  double gain(int worker, const PlacedObject& placed) {
    return scorers_[worker].gain(explanation_, models_[placed.model].object->mesh, placed.T_world_object) -
           penetration_cost(models_, placed, objects_, penetration_);
  }

  void align_and_climb(int worker, const AlignOptions& align, const ClimbOptions& climbing, Candidate& candidate) {
    candidate.gain = gain(worker, candidate.placed);
    align_and_climb_from_gain(worker, align, climbing, candidate);
  }

  // The same for a candidate whose gain is that of this level.
  void align_and_climb_from_gain(int worker, const AlignOptions& align, const ClimbOptions& climbing,
                                 Candidate& candidate) {
    PlacedObject& placed = candidate.placed;
    const auto objective = [&](const Pose& pose) { return gain(worker, {placed.model, pose, placed.freedom}); };
    const ObjectModel& model = models_[placed.model];
    const Pose aligned = align_to_readings(scorers_[worker], explanation_, model.object->mesh, placed.T_world_object,
                                           placed.freedom, align);
    ScoredPose start{placed.T_world_object, candidate.gain};
    const ScoredPose closer{aligned, objective(aligned)};
    if (closer.score > start.score) start = closer;
    const ScoredPose climbed = climb(objective, start, placed.freedom, model.radius, climbing);
    placed.T_world_object = climbed.T_world_object;
    candidate.gain = climbed.score;
  }

 private:
  const std::vector<ObjectModel>& models_;
  const Explanation& explanation_;
  const std::vector<PlacedObject>& objects_;
  double penetration_;
  std::vector<PoseScorer> scorers_;
};

// Applies improve(worker, candidate) to every candidate.
template <class Improve>
void improve_all(std::vector<Candidate>& candidates, int threads, const Improve& improve) {
  parallel_for(static_cast<std::int64_t>(candidates.size()), threads,
               [&](std::int64_t i, int worker) { improve(worker, candidates[static_cast<std::size_t>(i)]); });
}

}  // namespace

void add_view(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
              const PixelWindow& window, const DepthSigma& sigma, int coarse_stride,
              const std::vector<std::uint8_t>& ignored, ObservationPyramid& pyramid) {
  const auto level = [&](int stride, double extra_sigma) {
    PixelWindow at = window;
    at.stride = std::max(1, stride);
    DepthSigma lenient = sigma;
    lenient.constant += extra_sigma;
    Observation seen = observe(depth, camera, table, labels, at, lenient);
    ignore_labels(ignored, seen);
    return seen;
  };
  pyramid.coarse.push_back(level(coarse_stride, 0.005));
  pyramid.medium.push_back(level((coarse_stride + 1) / 2, 0.0015));
  pyramid.fine.push_back(level(1, 0.0));
}

PyramidScene explain(const ObservationPyramid& pyramid, const std::vector<ObjectModel>& models,
                     const std::vector<PlacedObject>& placed) {
  const auto on_level = [&](const std::vector<Observation>& observations) {
    PoseScorer scorer(observations);
    Explanation scene = scorer.empty_scene();
    for (const PlacedObject& object : placed) {
      scorer.add(models[object.model].object->mesh, object.T_world_object, scene);
    }
    return scene;
  };
  return {placed, on_level(pyramid.coarse), on_level(pyramid.medium), on_level(pyramid.fine)};
}

std::vector<Candidate> find_candidates(const std::vector<ObjectModel>& models, const ObservationPyramid& pyramid,
                                       const PyramidScene& scene, const Target& target, const Camera& camera,
                                       const Pose& T_world_camera, const CandidateOptions& options) {
  std::vector<PoseHypothesis> hypotheses;
  const HypothesisOptions guessing;
  add_resting_hypotheses(models, target, camera, T_world_camera, support_heights(models, scene.objects), guessing,
                         hypotheses);
  add_face_hypotheses(models, target, guessing, hypotheses);
  add_face_pair_hypotheses(models, target, guessing, hypotheses);

  std::vector<Candidate> candidates;
  for (const PoseHypothesis& guess : hypotheses) {
    candidates.push_back({{guess.model, guess.T_world_object, guess.freedom}, 0.0});
  }
  const auto level = [&](const std::vector<Observation>& observations, const Explanation& explanation,
                         double leniency) {
    return Level(models, observations, explanation, scene.objects, leniency * options.penetration, options.threads);
  };
  Level coarse = level(pyramid.coarse, scene.coarse, 6.0), medium = level(pyramid.medium, scene.medium, 3.0),
        fine = level(pyramid.fine, scene.fine, 1.0);
  improve_all(candidates, options.threads,
              [&](int worker, Candidate& candidate) { candidate.gain = coarse.gain(worker, candidate.placed); });
  candidates = best_distinct(std::move(candidates), models, options.coarse_kept, options.coarse_kept / 16);
  improve_all(candidates, options.threads, [&](int worker, Candidate& candidate) {
    coarse.align_and_climb_from_gain(worker, {3, 0.02, 0.01}, {0.004, 0.002, 1}, candidate);
  });
  candidates = best_distinct(std::move(candidates), models, options.medium_kept, options.medium_kept / 16);
  improve_all(candidates, options.threads, [&](int worker, Candidate& candidate) {
    medium.align_and_climb(worker, {3, 0.012, 0.006}, {0.002, 0.001, 2}, candidate);
  });
  candidates = best_distinct(std::move(candidates), models, options.fine_kept, 1);
  improve_all(candidates, options.threads, [&](int worker, Candidate& candidate) {
    fine.align_and_climb(worker, {2, 0.008, 0.006}, {0.001, 0.0005, 2}, candidate);
  });
  return best_distinct(std::move(candidates), models, options.fine_kept, 1);
}

bool alike(const ObjectModel& model, const Pose& a, const Pose& b, double distance, double angle) {
  if ((a.translation() - b.translation()).norm() > distance) return false;
  const Eigen::Matrix3d R = a.linear().transpose() * b.linear();
  return std::any_of(model.symmetries.begin(), model.symmetries.end(),
                     [&](const Eigen::Matrix3d& symmetry) { return rotation_angle(R * symmetry) < angle; });
}

}  // namespace dofusion
