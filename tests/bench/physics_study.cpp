// Whether the physics settings hold: settled scenes stay, verdicts do not hang on the time step, nothing creeps; and
// how varied generated scenes are. The figures stand in stability/README.md.
//
//   physics_study [--scenes 1000] [--seed 5] [--threads T]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <mutex>

#include "apps/program.h"
#include "stability/convex_hull.h"
#include "stability/generation.h"
#include "stability/outcome.h"
#include "stability/parallel_for.h"

namespace {

using namespace dofusion;
using Eigen::Vector3d;

struct StudyOptions {
  int scenes = 1000;
  std::uint64_t seed = 5;
  int threads = default_threads();
};

struct Shares {
  int yes = 0, all = 0;
  void add(bool value) {
    yes += value ? 1 : 0;
    ++all;
  }
  double pct() const { return 100.0 * yes / std::max(1, all); }
};

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

GenerationOptions generation(Task task, int objects, std::uint64_t seed) {
  GenerationOptions options;
  options.task = task;
  options.objects = objects;
  options.seed = seed;
  return options;
}

// What one thread needs for one kind of scene.
struct Worker {
  SceneGenerator generator;
  SceneDataset shapes;
  SimulatorCache usual, halved;
  explicit Worker(const GenerationOptions& options) : generator(options), halved(half_step()) {
    shapes.shapes = generator.shapes();
  }
  static PhysicsOptions half_step() {
    PhysicsOptions options;
    options.timestep /= 2.0;
    return options;
  }
  Scene scene(int index) { return to_scene(shapes, generator.generate(index)); }
};

// body(worker, scene index) for every scene, on all threads; results are added under the lock that body is given.
template <class Body>
GenerationStatistics for_scenes(const StudyOptions& study, const GenerationOptions& options, int count, Body body) {
  std::vector<std::unique_ptr<Worker>> workers;
  for (int t = 0; t < study.threads; ++t) workers.push_back(std::make_unique<Worker>(options));
  std::mutex mutex;
  parallel_for(count, study.threads, [&](std::int64_t i, int t) {
    body(*workers[static_cast<std::size_t>(t)], static_cast<int>(i), mutex);
  });
  GenerationStatistics sum;
  for (const auto& worker : workers) {
    const GenerationStatistics& s = worker->generator.statistics();
    sum.foreseen += s.foreseen;
    sum.drops += s.drops;
    sum.accepted += s.accepted;
    sum.shoves += s.shoves;
    sum.restarts += s.restarts;
  }
  return sum;
}

// (a) settled again, and (c) ten seconds of simulation: how far a settled scene moves.
void report_rest(const StudyOptions& study, int objects) {
  Shares stays, creeps;
  std::vector<double> moved, crept;
  const Task task = objects == 1 ? Task::kSingle : Task::kUnstructured;
  for_scenes(study, generation(task, objects, study.seed), study.scenes, [&](Worker& worker, int i, std::mutex& mutex) {
    const Scene scene = worker.scene(i);
    const Simulator& simulator = worker.usual.get(scene.objects);
    const auto displaced = [&](const SettleResult& result) {
      return displacement(scene.objects, scene.T_world_object, result.T_world_object);
    };
    const Displacement again = displaced(simulator.settle(scene.T_world_object));
    const bool long_run = i % 5 == 0;
    const Displacement later = long_run ? displaced(simulator.run(scene.T_world_object, {}, {10.0, false})) : Displacement{};
    const std::lock_guard<std::mutex> lock(mutex);
    stays.add(again.translation_pct < 0.1 && again.rotation_deg < 0.1);
    moved.push_back(std::max(again.translation_pct, again.rotation_deg));
    if (!long_run) return;
    creeps.add(later.translation_pct >= 1.0);
    crept.push_back(later.translation_pct);
  });
  std::printf("%d objects, settled again: %.2f %% of %d scenes move under 0.1 %% and 0.1 deg (median %.4f, 99th %.3f, largest %.2f)\n",
              objects, stays.pct(), stays.all, quantile(moved, 0.5), quantile(moved, 0.99), quantile(moved, 1.0));
  std::printf("           ten seconds: %.2f %% of %d scenes creep by 1 %% or more (median %.4f %%, 99th %.3f, largest %.2f)\n",
              creeps.pct(), creeps.all, quantile(crept, 0.5), quantile(crept, 0.99), quantile(crept, 1.0));
}

// (b) verdicts at the usual time step against half of it, on poses disturbed by 0.5 to 10 mm, which is where verdicts
// are hard.
void report_time_step(const StudyOptions& study) {
  Shares flips, stable;
  for_scenes(study, generation(Task::kUnstructured, 3, study.seed + 1), study.scenes, [&](Worker& worker, int i, std::mutex& mutex) {
    const Scene scene = worker.scene(i);
    Rng rng = make_rng(study.seed, static_cast<std::uint64_t>(i));
    const int query = uniform_int(rng, 0, 2);
    std::vector<Pose> poses = scene.T_world_object;
    const double sigma = std::exp(uniform(rng, std::log(0.0005), std::log(0.01)));
    poses[query].translation() += normal3(rng, sigma);
    poses[query].linear() = so3_exp(normal3(rng, sigma / 0.05)) * poses[query].linear();
    const auto verdict = [&](SimulatorCache& simulators) {
      return judge(scene.objects, poses, simulators.get(scene.objects).settle(poses), query).stable;
    };
    const bool usual = verdict(worker.usual), halved = verdict(worker.halved);
    const std::lock_guard<std::mutex> lock(mutex);
    stable.add(usual);
    flips.add(usual != halved);
  });
  std::printf("half the time step: %.2f %% of %d verdicts change (%.0f %% are stable)\n", flips.pct(), flips.all, stable.pct());
}

struct Face {
  Vector3d normal;
  double offset;
};

std::vector<Face> faces_of(const Object& object, const Pose& T_world_object) {
  std::vector<Face> faces;
  const TriangleMesh hull = convex_hull(object.mesh.vertices);
  for (const Eigen::Vector3i& t : hull.triangles) {
    const Vector3d a = T_world_object * hull.vertices[t[0]], b = T_world_object * hull.vertices[t[1]],
                   c = T_world_object * hull.vertices[t[2]];
    const Vector3d normal = (b - a).cross(c - a).normalized();
    const bool known = std::any_of(faces.begin(), faces.end(), [&](const Face& f) { return f.normal.dot(normal) > 1.0 - 1e-7; });
    if (!known) faces.push_back({normal, normal.dot(a)});
  }
  return faces;
}

// Two faces against each other, to a degree and half a millimetre.
bool face_on_face(const std::vector<Face>& a, const std::vector<Face>& b) {
  const double opposed = -std::cos(M_PI / 180.0);
  for (const Face& f : a) {
    for (const Face& g : b) {
      if (f.normal.dot(g.normal) < opposed && std::abs(f.offset + g.offset) < 5e-4) return true;
    }
  }
  return false;
}

bool has_face_down(const std::vector<Face>& faces) {
  return std::any_of(faces.begin(), faces.end(), [](const Face& f) { return f.normal.z() < -std::cos(2.0 * M_PI / 180.0); });
}

// Kinds of contact, leaning objects, and what falls when one object is taken away.
void report_variety(const StudyOptions& study, Task task, int objects) {
  Shares face_contacts, leaning, off_table, alone, removals, scenes_that_fall;
  const GenerationStatistics made = for_scenes(
      study, generation(task, objects, study.seed + 2), study.scenes / 2, [&](Worker& worker, int i, std::mutex& mutex) {
        const SceneRecord record = worker.generator.generate(i);
        const Scene scene = to_scene(worker.shapes, record);
        std::vector<std::vector<Face>> faces;
        for (std::size_t k = 0; k < scene.objects.size(); ++k) faces.push_back(faces_of(*scene.objects[k], scene.T_world_object[k]));
        std::vector<bool> falls;
        for (int k = 0; k < objects; ++k) {
          Scene rest = scene;
          rest.objects.erase(rest.objects.begin() + k);
          rest.T_world_object.erase(rest.T_world_object.begin() + k);
          const SettleResult settled = worker.usual.get(rest.objects).settle(rest.T_world_object);
          falls.push_back(settled.status != SettleStatus::kSettled ||
                          !is_stable(displacement(rest.objects, rest.T_world_object, settled.T_world_object)));
        }
        const std::lock_guard<std::mutex> lock(mutex);
        for (int k = 0; k < objects; ++k) {
          const std::uint32_t touches = record.objects[k].touches;
          leaning.add(!has_face_down(faces[k]));
          off_table.add((touches & 1u) == 0);
          alone.add(touches == 1u);
          removals.add(falls[k]);
          for (int j = k + 1; j < objects; ++j) {
            if ((touches >> (j + 1)) & 1u) face_contacts.add(face_on_face(faces[k], faces[j]));
          }
        }
        scenes_that_fall.add(std::any_of(falls.begin(), falls.end(), [](bool f) { return f; }));
      });
  std::printf(
      "%s of %d: %.2f contacts a scene, %.0f %% of them face on face | objects: %.0f %% lean, %.0f %% are off the table, "
      "%.0f %% touch no other | taking one away lets another fall: %.0f %% of objects, %.0f %% of scenes | %.0f %% of "
      "drops kept, %.1f looks ahead and %.1f drops a scene\n",
      to_string(task).c_str(), objects, static_cast<double>(face_contacts.all) / scenes_that_fall.all, face_contacts.pct(),
      leaning.pct(), off_table.pct(), alone.pct(), removals.pct(), scenes_that_fall.pct(),
      100.0 * static_cast<double>(made.accepted) / static_cast<double>(made.drops),
      static_cast<double>(made.foreseen) / scenes_that_fall.all, static_cast<double>(made.drops) / scenes_that_fall.all);
}

}  // namespace

int main(int argc, char** argv) {
  StudyOptions study;
  CLI::App app{"Measures what the physics settings and the scene generator are worth.", "physics_study"};
  app.add_option("--scenes", study.scenes)->check(CLI::Range(10, 1'000'000))->capture_default_str();
  app.add_option("--seed", study.seed)->capture_default_str();
  app.add_option("--threads", study.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  return run_program(app, argc, argv, [&] {
    report_rest(study, 1);
    report_rest(study, 3);
    report_time_step(study);
    report_variety(study, Task::kUnstructured, 2);
    report_variety(study, Task::kUnstructured, 3);
    report_variety(study, Task::kStack, 3);
  });
}
