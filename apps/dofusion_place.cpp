// The main job: a depth image and a query object to ranked, physics-checked placements and a report.
#include <cstdio>

#include "apps/place_job.h"
#include "apps/program.h"
#include "apps/stopwatch.h"
#include "stability/files.h"

using namespace dofusion;

int main(int argc, char** argv) {
  CLI::App app{
      "Finds poses for a query object that leave the whole scene of a depth image standing.\n\nExamples:\n"
      "  dofusion-place --depth depth.png --camera camera.json --query cube --out placements\n"
      "  dofusion-place --depth depth.png --camera camera.json --objects assets/blocks --query hat --out placements\n"
      "  dofusion-place --cloud scene.pcd --camera camera.json --query mug.stl --query-unit 0.001 --out placements",
      "dofusion-place"};
  PlaceArguments arguments;
  std::string out, json;
  bool unknown = false, raw = false;
  arguments.placement.threads = default_threads();
  auto* depth = app.add_option("--depth", arguments.depth, "16-bit depth image (PNG)");
  auto* cloud = app.add_option("--cloud", arguments.cloud, "a cloud (.pcd, .ply) in the camera's frame instead");
  depth->excludes(cloud);
  app.add_option("--camera", arguments.camera, "camera.json: fx, fy, cx, cy, width, height, depth_scale")->required();
  app.add_option("--query", arguments.query, "a block (cube, rectangle, half_rectangle, tall_triangle, middle_triangle, "
                                             "tetrahedron, hat) or a mesh file in metres")
      ->required();
  app.add_option("--query-unit", arguments.query_unit, "metres in a unit of the query's mesh: 0.001 for millimetres")
      ->check(CLI::PositiveNumber);
  auto* objects = app.add_option("--objects", arguments.objects, "folder of meshes: the objects on the table are among these");
  app.add_option("--objects-unit", arguments.objects_unit, "metres in a unit of those meshes")->check(CLI::PositiveNumber);
  app.add_flag("--unknown", unknown, "nothing is known of the objects on the table (the default)")->excludes(objects);
  app.add_option("--mask", arguments.mask, "8-bit image: the objects' pixels, one value each, in place of our own segmentation");
  app.add_option("--samples", arguments.placement.samples, "candidate poses")->check(CLI::Range(1, 100000))->capture_default_str();
  app.add_option("--steps", arguments.placement.steps, "reverse steps of the sampler")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_flag("--raw", raw, "keep the model's poses; otherwise a stable one is replaced by where it came to rest");
  app.add_option("--model", arguments.model, "a model file; default: the shipped one");
  app.add_option("--seed", arguments.placement.seed)->check(CLI::NonNegativeNumber)->capture_default_str();
  app.add_option("--threads", arguments.placement.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", json, "write placements.json here as well");
  app.add_option("--out", out, "folder for placements.json, scene.xml, report.html, …")->required();

  return run_program(app, argc, argv, [&] {
    if (arguments.depth.empty() == arguments.cloud.empty()) throw InputError("give --depth or --cloud; see --help");
    arguments.placement.polish = !raw;
    Stopwatch watch;
    if (out.empty()) throw InputError("--out: the name of a folder is needed");
    if (!json.empty()) check_writable(json);
    OutputDirectory output(out);  // an --out that cannot be written fails before the work
    check_inputs_survive(arguments, out);
    const PlaceInputs inputs = load_inputs(arguments);
    const double load_ms = watch.lap_ms();
    PlaceResult result = run_placement(inputs, arguments);
    result.timing_ms.insert(result.timing_ms.begin(), {"load", load_ms});
    write_outputs(output.path().string(), inputs, arguments, result);
    if (!json.empty()) write_file(json, placements_json(inputs, arguments, result));
    output.commit();
    std::printf("%s\nreport: %s/report.html\n", summary_line(inputs, result).c_str(), out.c_str());
  });
}
