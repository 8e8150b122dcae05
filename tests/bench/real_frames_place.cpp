// The whole way on real depth images of unknown objects: the share of runs whose first placement stands on the recovered
// scene, for a small cube, a box of 40 x 60 x 120 mm and a mug of 100 mm.
//
//   real_frames_place --real DIR [--first 0] [--last 44] [--threads N]     DIR: mOSD's learn<i>_depth.png and camera.json
#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "apps/place_job.h"
#include "apps/program.h"
#include "apps/stopwatch.h"
#include "stability/files.h"
#include "stability/metrics.h"
#include "stability/shape_families.h"
#include "stability/shapes.h"

using namespace dofusion;

namespace {

ObjectPtr mug_of_height(double height) {
  Rng rng = make_rng(4);
  const ObjectPtr mug = draw_shape(ShapeFamilyKind::kMug, rng);
  const BoundingBox box = bounding_box(mug->mesh);
  return scaled(*mug, Eigen::Vector3d::Constant(height / (box.max - box.min).z()));
}

struct Tally {
  int runs = 0, stable = 0;
  std::vector<double> seconds, probability;
};

void run(const PlaceInputs& inputs, const PlaceArguments& arguments, int frame, const std::string& query, Tally& tally) {
  Stopwatch watch;
  const PlaceResult result = run_placement(inputs, arguments);
  tally.seconds.push_back(1e-3 * watch.lap_ms());
  ++tally.runs;
  const bool stable = !result.placements.empty() && result.placements.front().stable;
  tally.stable += stable ? 1 : 0;
  if (stable) tally.probability.push_back(result.placements.front().stable_probability.value_or(0.0));
  if (!stable) std::printf("frame %d, %s: no stable placement\n", frame, query.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Placements on real depth images of unknown objects.", "real_frames_place"};
  std::string folder;
  int first = 0, last = 44;
  PlacementOptions placing;
  placing.samples = 32;
  placing.threads = default_threads();
  app.add_option("--real", folder, "folder of learn<i>_depth.png and camera.json")->required();
  app.add_option("--first", first)->capture_default_str();
  app.add_option("--last", last)->capture_default_str();
  app.add_option("--threads", placing.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  return run_program(app, argc, argv, [&] {
    const std::vector<std::pair<std::string, ObjectPtr>> queries = {
        {"cube", make_block("cube")}, {"box", make_box("box", {0.04, 0.06, 0.12})}, {"mug", mug_of_height(0.1)}};
    std::vector<Tally> boxes(queries.size()), all(queries.size());  // frames 0 to 24 hold boxes
    for (int frame = first; frame <= last; ++frame) {
      PlaceArguments arguments;
      arguments.depth = folder + "/learn" + std::to_string(frame) + "_depth.png";
      arguments.camera = folder + "/camera.json";
      arguments.placement = placing;
      PlaceInputs inputs = load_inputs(arguments);
      for (std::size_t q = 0; q < queries.size(); ++q) {
        if (interrupted()) throw Interrupted("interrupted");
        inputs.query = queries[q].second;
        run(inputs, arguments, frame, queries[q].first, all[q]);
        if (frame == 24) boxes[q] = all[q];
      }
    }
    const auto print = [](const std::string& name, const Tally& t) {
      std::printf("%-28s first placement stands %d of %d; median: probability %.2f, %.2f s\n", name.c_str(), t.stable,
                  t.runs, median(t.probability), median(t.seconds));
    };
    for (std::size_t q = 0; q < queries.size(); ++q) {
      if (boxes[q].runs > 0) print(queries[q].first + ", frames up to 24", boxes[q]);
      print(queries[q].first + ", all frames", all[q]);
    }
  });
}
