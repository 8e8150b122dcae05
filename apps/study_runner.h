// One trial of the perception-noise study: the whole chain from a scene to a settled placement.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/pipeline.h"
#include "apps/placement.h"
#include "apps/study_config.h"
#include "apps/study_rows.h"
#include "diffusion/sampler.h"
#include "perception/synthetic_view.h"
#include "stability/scene.h"

namespace dofusion {

// A stable scene and a block to place into it.
struct StudyScene {
  std::int64_t index = 0;
  Task task = Task::kSingle;
  Scene truth;  // without the query
  ObjectPtr query;
  std::optional<std::size_t> on;  // the object that the query is wished on, of the true scene
};

// A trial's row and what it was made from, for pictures.
struct StudyTrial {
  StudyRow row;
  std::vector<SyntheticView> views;
  RecoveredScene recovered;
  std::optional<Placement> best;   // the placement that was taken; none without a table
  std::vector<Pose> settled_true;  // the true scene's objects and then the query, at rest after it was put there
  Pose T_true_recovered = Pose::Identity();  // the recovered world in the true one, as the robot believes
};

// The model file of a condition.
std::string model_path(const StudyCondition& condition);

// The models that a study's series name, each read once.
class StudyModels {
 public:
  explicit StudyModels(const StudyConfig& config);  // throws InputError naming a file that cannot be read
  const PlacementModel& of(const StudyCondition& condition) const;

 private:
  std::map<std::string, PlacementModel> models_;  // by path
};

// Runs trials. Of n trials a scene has, one for each series and noise scale, trial t is number t mod n of scene t / n:
// the first series at all scales, then the next. It depends on the configuration, the seed and t alone. One per thread.
class StudyRunner {
 public:
  // `library`: the objects that the known ones are looked for among. `models` must live as long as the runner.
  StudyRunner(const StudyConfig& config, std::uint64_t seed, const StudyModels& models, std::vector<ObjectPtr> library);
  ~StudyRunner();

  StudyScene make_scene(std::int64_t index);

  // The row of a trial without what depends on the series: the scene and its two references.
  StudyRow reference_row(const StudyScene& scene) const;

  // Scan, recover, place, and settle in both scenes: completes the scene's reference row.
  StudyTrial run(const StudyScene& scene, std::int64_t trial, const StudyRow& reference) const;

 private:
  const StudyCondition& set_condition(std::int64_t trial, StudyRow& row) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The seven blocks from the shipped files.
std::vector<ObjectPtr> load_block_library();

}  // namespace dofusion
