#include "apps/evaluation.h"

#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "apps/program.h"
#include "stability/parallel_for.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

constexpr std::int64_t kStreamsPerInstance = 1'000'000;  // scene numbers an instance may try to find its shape

// The scene without its object `query`.
Instance take_away(const Scene& scene, int query, Task task, SimulatorCache& simulators) {
  Instance instance;
  instance.query = scene.objects[static_cast<std::size_t>(query)];
  instance.T_world_query = scene.T_world_object[static_cast<std::size_t>(query)];
  instance.task = task;
  Scene& context = instance.context = scene;
  context.objects.erase(context.objects.begin() + query);
  context.T_world_object.erase(context.T_world_object.begin() + query);
  if (context.objects.empty()) return instance;
  const SettleResult alone = simulators.get(context.objects).settle(context.T_world_object);
  instance.context_stands = judge(diameters_of(context.objects), context.T_world_object, alone).stable;
  return instance;
}

}  // namespace

std::vector<Instance> make_instances(const InstanceOptions& options) {
  if (options.shape) block_mesh(*options.shape);  // throws on an unknown name
  const bool blocks = options.shapes == ShapeFamily::kBlocks;
  if (options.shape && !blocks) throw std::invalid_argument("a block as the query needs scenes of blocks");
  GenerationOptions generation;
  generation.task = options.task;
  generation.objects = options.context + 1;
  generation.shapes = options.shapes;
  generation.seed = options.seed;
  std::vector<std::unique_ptr<SceneGenerator>> generators;
  std::vector<std::unique_ptr<SimulatorCache>> simulators;
  for (int t = 0; t < options.threads; ++t) {
    generators.push_back(std::make_unique<SceneGenerator>(generation));
    simulators.push_back(std::make_unique<SimulatorCache>());
  }
  // Shapes of one generator, so that equal blocks are one object for all threads.
  SceneDataset shapes;
  shapes.shapes = generators.front()->shapes();

  std::vector<Instance> instances(static_cast<std::size_t>(options.count));
  parallel_for(options.count, options.threads, [&](std::int64_t i, int thread) {
    const std::string wanted = options.shape.value_or(block_names()[static_cast<std::size_t>(i) % 7]);
    for (std::int64_t k = 0;; ++k) {
      if (interrupted()) throw Interrupted("interrupted");
      const std::int64_t index = i * kStreamsPerInstance + k;
      const SceneRecord record = generators[static_cast<std::size_t>(thread)]->generate(index);
      Rng rng = make_rng(options.seed ^ 0x9e3779b97f4a7c15ull, static_cast<std::uint64_t>(index));
      const int last = static_cast<int>(record.objects.size()) - 1;
      const int query = options.task == Task::kStack ? last : uniform_int(rng, 0, last);
      const int shape = record.objects[static_cast<std::size_t>(query)].shape;
      if (blocks && shapes.shapes[static_cast<std::size_t>(shape)]->name != wanted) continue;
      instances[static_cast<std::size_t>(i)] =
          take_away(to_scene(shapes, record), query, options.task, *simulators[static_cast<std::size_t>(thread)]);
      return;
    }
  });
  return instances;
}

std::vector<Instance> instances_of(const std::vector<SceneDataset>& datasets, int count, std::uint64_t seed) {
  std::vector<std::pair<const SceneDataset*, const SceneRecord*>> scenes;
  for (const SceneDataset& dataset : datasets)
    for (const SceneRecord& record : dataset.scenes) scenes.emplace_back(&dataset, &record);
  const std::size_t all = scenes.size(), wanted = std::min(all, static_cast<std::size_t>(count));
  std::vector<Instance> instances;
  SimulatorCache simulators;
  for (std::size_t i = 0; i < wanted; ++i) {
    const auto& [dataset, record] = scenes[i * all / wanted];
    Rng rng = make_rng(seed ^ 0x696e7374u, i);
    const int last = static_cast<int>(record->objects.size()) - 1;
    const int query = record->task == Task::kStack ? last : uniform_int(rng, 0, last);
    instances.push_back(take_away(to_scene(*dataset, *record), query, record->task, simulators));
  }
  return instances;
}

std::vector<Outcome> settle_placements(const std::vector<Instance>& instances, const std::vector<Pose>& T_world_query,
                                       int threads, const PhysicsOptions& physics) {
  if (T_world_query.size() != instances.size()) throw std::invalid_argument("one pose per instance is needed");
  std::vector<std::unique_ptr<SimulatorCache>> simulators;
  for (int t = 0; t < threads; ++t) simulators.push_back(std::make_unique<SimulatorCache>(physics));
  std::vector<Outcome> outcomes(instances.size());
  parallel_for(static_cast<std::int64_t>(instances.size()), threads, [&](std::int64_t i, int thread) {
    const Instance& instance = instances[static_cast<std::size_t>(i)];
    std::vector<ObjectPtr> objects = instance.context.objects;
    std::vector<Pose> start = instance.context.T_world_object;
    objects.push_back(instance.query);
    start.push_back(T_world_query[static_cast<std::size_t>(i)]);
    const SettleResult settled = simulators[static_cast<std::size_t>(thread)]->get(objects).settle(start);
    outcomes[static_cast<std::size_t>(i)] = judge(objects, start, settled, static_cast<int>(objects.size()) - 1);
  });
  return outcomes;
}

std::vector<PlacementProblem> placement_problems(const std::vector<Instance>& instances, std::uint64_t seed) {
  std::vector<PlacementProblem> problems;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    PlacementProblem problem;
    problem.context = instances[i].context;
    problem.query = instances[i].query;
    problem.seed = make_rng(seed, i)();
    problem.centre = default_centre(problem.context);
    problems.push_back(std::move(problem));
  }
  return problems;
}

std::vector<Pose> sample_placements(const std::vector<Instance>& instances, const PlacementModel& model,
                                    std::uint64_t seed, const SamplerOptions& options) {
  return model.sample(placement_problems(instances, seed), options);
}

std::vector<Pose> random_placements(const std::vector<Instance>& instances, std::uint64_t seed) {
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    Rng rng = make_rng(seed, i);
    poses.push_back(random_placement(instances[i].context, *instances[i].query, instances[i].task, rng));
  }
  return poses;
}

std::vector<Pose> held_out_placements(const std::vector<Instance>& instances) {
  std::vector<Pose> poses;
  for (const Instance& instance : instances) poses.push_back(instance.T_world_query);
  return poses;
}

int contact_mode(const Outcome& outcome) { return (outcome.on_table ? 0 : 3) + std::min(outcome.touches, 2); }

std::string contact_mode_name(int mode) {
  static const std::array<const char*, kContactModes> names = {
      "table alone",  "table and one object", "table and several objects",
      "held by none", "one object",           "several objects"};
  return names.at(static_cast<std::size_t>(mode));
}

double contact_entropy(const std::vector<Outcome>& outcomes) {
  std::array<int, kContactModes> counts{};
  int all = 0;
  for (const Outcome& outcome : outcomes) {
    if (!outcome.stable) continue;
    ++counts[static_cast<std::size_t>(contact_mode(outcome))];
    ++all;
  }
  double entropy = 0.0;
  for (const int count : counts) {
    const double share = static_cast<double>(count) / std::max(all, 1);
    if (count > 0) entropy -= share * std::log2(share);
  }
  return entropy;
}

double support_share(const std::vector<Instance>& instances, const std::vector<Outcome>& outcomes) {
  int needed = 0, given = 0;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    if (instances[i].context_stands) continue;
    ++needed;
    given += outcomes[i].stable ? 1 : 0;
  }
  return needed > 0 ? static_cast<double>(given) / needed : std::nan("");
}

}  // namespace dofusion
