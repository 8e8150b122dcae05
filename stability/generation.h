// Random stable scenes: blocks dropped one by one, or stacked (section "Dataset generation" of the paper).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stability/dataset.h"
#include "stability/physics.h"

namespace dofusion {

enum class ShapeFamily {
  kBlocks,   // the seven blocks at their own size
  kGeneral,  // the families of shape_families.h and the blocks, ten kinds in equal shares, diameters up to 3 times apart
};
ShapeFamily shape_family_from_string(const std::string& name);  // "blocks" or "general"; std::invalid_argument

struct GenerationOptions {
  Task task = Task::kUnstructured;
  int objects = 2;                          // 1 … 6; a single scene has one
  ShapeFamily shapes = ShapeFamily::kBlocks;
  std::uint64_t seed = 0;
  double apart = 0.2;                       // share of dropped objects that may come to rest touching no other
  PhysicsOptions physics;
};

struct GenerationStatistics {
  std::int64_t foreseen = 0;  // drops tried with the other objects fixed, to skip those that come to rest alone
  std::int64_t drops = 0;     // simulations of a new object among free ones
  std::int64_t shoves = 0;    // of these pushed along the table towards a neighbour
  std::int64_t accepted = 0;  // of these kept
  std::int64_t restarts = 0;  // scenes begun anew
};

// Draws scenes one by one. Scene `index` depends on options and index alone, so any thread may draw it. One
// generator per thread.
class SceneGenerator {
 public:
  explicit SceneGenerator(const GenerationOptions& options);  // throws std::invalid_argument
  ~SceneGenerator();

  // A scene at rest: simulated until nothing moves, every object held by others or the table.
  SceneRecord generate(std::int64_t index);

  // The same, or nullopt soon after `stop` has come true: a scene of many objects can take a second.
  std::optional<SceneRecord> generate(std::int64_t index, const std::function<bool()>& stop);

  const std::vector<ObjectPtr>& shapes() const;
  const GenerationStatistics& statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// What `options` say, as JSON text for SceneDataset::settings.
std::string to_json(const GenerationOptions& options);

// The random baseline of the paper: orientation uniform on SO(3); x, y Gaussian about the mean position of the
// context (about the origin without context) with the standard deviation of one query diameter, or, for stacking,
// the x, y of the highest context object; just high enough to touch nothing.
Pose random_placement(const Scene& context, const Object& query, Task task, Rng& rng);

}  // namespace dofusion
