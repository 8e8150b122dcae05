// The perception-noise study: the whole chain from a scene to a settled placement, many times, under growing noise.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apps/study_config.h"
#include "apps/study_rows.h"
#include "diffusion/sampler.h"
#include "stability/scene.h"

namespace dofusion {

// A stable scene and a block to place into it.
struct StudyScene {
  std::int64_t index = 0;
  Task task = Task::kSingle;
  Scene truth;  // without the query
  ObjectPtr query;
};

// Runs trials. Trial t is the scene t / n at the noise scale t mod n, n the number of noise scales; it depends on the
// configuration, the seed and t alone. One per thread.
class StudyRunner {
 public:
  // `library`: the objects that the known ones are looked for among; unused if they are unknown. `model` must live
  // as long as the runner.
  StudyRunner(const StudyConfig& config, std::uint64_t seed, const PlacementModel& model,
              std::vector<ObjectPtr> library);
  ~StudyRunner();

  StudyScene make_scene(std::int64_t index);

  // The row of a trial without what depends on perception: the scene and its two references.
  StudyRow reference_row(const StudyScene& scene) const;

  // Scan, recover, place, and settle in both scenes: completes the scene's reference row.
  StudyRow run(const StudyScene& scene, std::int64_t trial, StudyRow reference) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The seven blocks from the shipped files.
std::vector<ObjectPtr> load_block_library();

struct StudyJob {
  StudyConfig config;
  std::int64_t trials = 200;
  std::uint64_t seed = 0;
  int threads = 1;
  std::string partial;  // file for the rows while the study runs
};

// What identifies a study besides the number of trials, as JSON in one line: configuration, seed and the model file's
// hash. A partial file of other settings is refused.
std::string study_settings(const StudyJob& job);

// Runs the trials that the partial file lacks. Returns all rows, by trial. Throws Interrupted after Ctrl-C; the partial
// file then holds every finished trial.
std::vector<StudyRow> run_study(const StudyJob& job);

}  // namespace dofusion
