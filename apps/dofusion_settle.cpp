// Lets a scene go in physics and says how far everything moved.
#include <cstdio>

#include "apps/program.h"
#include "apps/settle_job.h"
#include "stability/files.h"

using namespace dofusion;

int main(int argc, char** argv) {
  CLI::App app{
      "Simulates a scene until everything rests, and says how far each body moved, what it touches and whether the "
      "scene stood. A scene that falls is a result, not an error.\n\nExamples:\n"
      "  dofusion-settle scene.xml\n"
      "  dofusion-settle robot.xml --keyframe home --time-limit 10 --json robot.json\n"
      "  dofusion-settle --data scenes.h5 --scene 17 --query hat --out settled",
      "dofusion-settle"};
  SettleJob job;
  std::string json;
  auto* file = app.add_option("file", job.mjcf, "an MJCF file; it is simulated with its own settings");
  app.add_option("--keyframe", job.keyframe, "start from this keyframe of the file: its name or number")->needs(file);
  auto* data =
      app.add_option("--data", job.data, "or a scene of this dataset (HDF5, of dofusion-generate)")->excludes(file);
  app.add_option("--scene", job.scene, "its number in the dataset, from 0")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{1'000'000'000}))
      ->capture_default_str()
      ->needs(data);
  app.add_option("--query", job.query,
                 "name or index of a body: how strong a push it withstands, and whether it comes off upside down");
  app.add_option("--time-limit", job.time_limit, "simulated seconds until a scene that still moves is given up")
      ->check(CLI::Range(1e-3, 1e4))
      ->capture_default_str();
  app.add_option("--json", json, "write the result to this file");
  app.add_option("--out", job.out, "a folder for the settled scene: scene.xml, which MuJoCo opens, and its meshes");

  return run_program(app, argc, argv, [&] {
    if (job.mjcf.empty() && job.data.empty()) {
      throw InputError("an MJCF file or --data is needed; see dofusion-settle --help");
    }
    if (!json.empty()) check_writable(json);
    const SettleReport report = settle_scene(job);
    if (!json.empty()) {
      // Names in MJCF files need not be UTF-8.
      write_file(json, to_json(report).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
    }
    summary(to_text(report));
  });
}
