#include "apps/generate_job.h"

#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

#include "apps/program.h"
#include "apps/shared_work.h"
#include "stability/dataset_journal.h"
#include "stability/files.h"

namespace dofusion {
namespace {

using nlohmann::ordered_json;

// Makes scenes by their number in the plan; one generator a thread, for the part that the thread is at.
class SceneMaker {
 public:
  SceneMaker(GenerationPlan plan, int threads) : plan_(std::move(plan)), threads_(static_cast<std::size_t>(threads)) {}

  // The scene as a journal's entry.
  std::string make(std::int64_t number, int thread) {
    const PlannedScene planned = scene_at(plan_, number);
    Worker& worker = threads_.at(static_cast<std::size_t>(thread));
    if (!worker.generator || worker.part != planned.part) {
      worker.part = planned.part;
      worker.generator = std::make_unique<SceneGenerator>(plan_.parts[static_cast<std::size_t>(planned.part)].options);
    }
    const GenerationStatistics before = worker.generator->statistics();
    JournalEntry entry;
    std::optional<SceneRecord> scene = worker.generator->generate(planned.index, interrupted);
    if (!scene) throw Interrupted("interrupted");
    entry.scene = std::move(*scene);
    entry.scene.part = planned.part;
    const GenerationStatistics& after = worker.generator->statistics();
    entry.drops = after.drops - before.drops;
    entry.accepted = after.accepted - before.accepted;
    entry.restarts = after.restarts - before.restarts;
    return encode_entry(entry);
  }

 private:
  struct Worker {
    int part = 0;
    std::unique_ptr<SceneGenerator> generator;
  };
  GenerationPlan plan_;
  std::vector<Worker> threads_;
};

Work work_of(const GenerationPlan& plan, int threads) {
  const auto maker = std::make_shared<SceneMaker>(plan, threads);
  return [maker](std::int64_t number, int thread) { return maker->make(number, thread); };
}

std::vector<std::int64_t> missing_scenes(const GenerationPlan& plan, const SceneJournal& journal) {
  std::vector<bool> there(static_cast<std::size_t>(scene_count(plan)));
  journal.for_each([&](const JournalEntry& entry) {
    there.at(static_cast<std::size_t>(number_of(plan, {entry.scene.part, entry.scene.index}))) = true;
  });
  std::vector<std::int64_t> missing;
  for (std::size_t i = 0; i < there.size(); ++i) {
    if (!there[i]) missing.push_back(static_cast<std::int64_t>(i));
  }
  return missing;
}

bool same_shape(const Object& a, const Object& b) {
  return a.name == b.name && a.kind == b.kind && a.mesh.vertices == b.mesh.vertices &&
         a.mesh.triangles == b.mesh.triangles;
}

// The shapes of all parts, each once, and where those of a part are among them.
struct PlanShapes {
  std::vector<ObjectPtr> shapes;
  std::vector<std::vector<int>> of_part;  // by part and the generator's own index
};

PlanShapes shapes_of(const GenerationPlan& plan) {
  PlanShapes all;
  for (const PlanPart& part : plan.parts) {
    std::vector<int>& indices = all.of_part.emplace_back();
    const SceneGenerator generator(part.options);
    for (const ObjectPtr& shape : generator.shapes()) {
      const auto known = std::find_if(all.shapes.begin(), all.shapes.end(),
                                      [&](const ObjectPtr& other) { return same_shape(*shape, *other); });
      indices.push_back(static_cast<int>(known - all.shapes.begin()));
      if (known == all.shapes.end()) all.shapes.push_back(shape);
    }
  }
  return all;
}

// What it took to make a part's scenes, and where they belong.
struct Tally {
  std::int64_t scenes = 0, drops = 0, accepted = 0, restarts = 0;
  std::array<std::int64_t, 3> of_split{};

  void add(const JournalEntry& entry) {
    ++scenes;
    drops += entry.drops;
    accepted += entry.accepted;
    restarts += entry.restarts;
    ++of_split[static_cast<std::size_t>(entry.scene.split)];
  }
  void add(const Tally& other) {
    scenes += other.scenes;
    drops += other.drops;
    accepted += other.accepted;
    restarts += other.restarts;
    for (std::size_t i = 0; i < of_split.size(); ++i) of_split[i] += other.of_split[i];
  }
  double acceptance() const {
    return static_cast<double>(accepted) / static_cast<double>(std::max<std::int64_t>(1, drops));
  }
};

struct FinishedDataset {
  SceneDataset dataset;
  std::vector<Tally> parts;
};

// All scenes of a complete journal in the plan's order, with the dataset's own shapes and splits.
FinishedDataset assemble(const GenerationPlan& plan, const SceneJournal& journal) {
  PlanShapes shapes = shapes_of(plan);
  FinishedDataset result;
  result.parts.resize(plan.parts.size());
  result.dataset.shapes = std::move(shapes.shapes);
  result.dataset.settings = to_json(plan);
  result.dataset.scenes.resize(static_cast<std::size_t>(scene_count(plan)));
  journal.for_each([&](JournalEntry entry) {
    SceneRecord& scene = entry.scene;
    const auto number = static_cast<std::size_t>(number_of(plan, {scene.part, scene.index}));
    if (!result.dataset.scenes.at(number).objects.empty()) return;  // twice: a damaged entry was made again
    const auto part = static_cast<std::size_t>(scene.part);
    for (SceneObject& object : scene.objects) {
      object.shape = shapes.of_part.at(part).at(static_cast<std::size_t>(object.shape));
    }
    scene.split = split_of(plan.seed, scene.part, scene.index, plan.shares);
    result.parts[part].add(entry);
    result.dataset.scenes[number] = std::move(scene);
  });
  return result;
}

ordered_json to_json(const Tally& tally) {
  return {{"scenes", tally.scenes},
          {"splits", {{"train", tally.of_split[0]}, {"validation", tally.of_split[1]}, {"test", tally.of_split[2]}}},
          {"drops", tally.drops},
          {"accepted", tally.accepted},
          {"acceptance", tally.acceptance()},
          {"restarts", tally.restarts}};
}

ordered_json summary_of(const GenerationPlan& plan, const std::vector<Tally>& tallies, const Tally& total) {
  ordered_json parts = ordered_json::array();
  for (std::size_t k = 0; k < tallies.size(); ++k) {
    const auto options = nlohmann::json::parse(to_json(plan.parts[k].options));
    ordered_json part{{"task", options.at("task")},
                      {"objects", options.at("objects")},
                      {"shapes", options.at("shapes")},
                      {"seed", options.at("seed")}};
    part.update(to_json(tallies[k]));
    parts.push_back(std::move(part));
  }
  ordered_json summary{{"format", "dofusion-generate"}, {"version", 1}, {"seed", plan.seed}};
  summary.update(to_json(total));
  summary["parts"] = std::move(parts);
  return summary;
}

void refuse_bad_output(const std::string& out) {
  std::error_code error;
  if (std::filesystem::exists(out, error) && !std::filesystem::is_regular_file(out, error)) {
    throw InputError(out + ": is not a file; a dataset cannot be written there");
  }
  check_writable(out);
}

}  // namespace

std::string journal_path(const std::string& out) { return out + ".partial"; }

GenerateResult generate_dataset(Ranks& ranks, const GenerationPlan& plan, const std::string& out, int threads) {
  const auto begin = std::chrono::steady_clock::now();
  refuse_bad_output(out);
  const std::string settings = to_json(plan);
  SceneJournal journal(journal_path(out), settings);

  const std::int64_t count = scene_count(plan);
  const std::vector<std::int64_t> missing = missing_scenes(plan, journal);
  std::int64_t done = count - static_cast<std::int64_t>(missing.size());
  const std::int64_t resumed = done;
  if (resumed > 0) {
    note("continuing with the " + std::to_string(resumed) + " scenes of " + journal_path(out));
  }
  try {
    Progress progress("scenes", count, done);
    const auto collect = [&](std::int64_t, const std::string& entry) {
      journal.append(entry);
      progress.update(++done);
    };
    share_work(ranks, {settings, missing, work_of(plan, threads), collect, threads});
  } catch (const Interrupted&) {
    throw Interrupted("interrupted; the same command goes on from " + journal_path(out));
  }

  const FinishedDataset finished = assemble(plan, journal);
  write_dataset(finished.dataset, out);
  journal.remove();

  Tally total;
  for (const Tally& part : finished.parts) total.add(part);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  GenerateResult result;
  result.summary = summary_of(plan, finished.parts, total);
  result.summary.update(ordered_json{
      {"out", out}, {"seconds", seconds}, {"resumed", resumed}, {"ranks", ranks.count()}, {"threads", threads}});
  char line[256];
  std::snprintf(line, sizeof line, ": %ld scenes; of %ld simulated drops %.0f %% kept, %ld scenes begun anew",
                static_cast<long>(total.scenes), static_cast<long>(total.drops), 100.0 * total.acceptance(),
                static_cast<long>(total.restarts));
  result.line = out + line;
  return result;
}

void help_to_generate(Ranks& ranks, const std::function<GenerationPlan()>& make_plan, int threads) {
  serve(ranks, threads, [&](const std::string& settings) {
    const GenerationPlan plan = make_plan();
    if (to_json(plan) != settings) throw InputError("has another plan than the first rank; is it another version?");
    return work_of(plan, threads);
  });
}

}  // namespace dofusion
