// The main job: a depth image and a query object to ranked, physics-checked placements and a report.
#include <array>
#include <cstdio>
#include <tuple>

#include "apps/place_job.h"
#include "apps/program.h"
#include "apps/stopwatch.h"
#include "stability/files.h"

using namespace dofusion;

namespace {

const char* const kDescription =
    "Finds poses for a query object that leave the whole scene of a depth image standing.\n\nExamples:\n"
    "  dofusion-place --depth depth.png --camera camera.json --query cube --out placements\n"
    "  dofusion-place --depth depth.png --camera camera.json --objects assets/blocks --query hat --out placements\n"
    "  dofusion-place --cloud scene.pcd --camera camera.json --query mug.stl --query-unit 0.001 --out placements\n"
    "  dofusion-place --view a.png camera.json a.json --view b.png camera.json b.json --query cube --out placements\n"
    "  dofusion-place --bop DATASET --scene 0 --image 3 --bop-models --query cube --out placements";

constexpr int kUnreachable = 3;  // exit status: the files are there, but no stable placement meets the wishes

using ViewWords = std::vector<std::tuple<std::string, std::string, std::string>>;

void add_image_options(CLI::App& app, PlaceArguments& arguments, ViewWords& views) {
  const std::string group = "The scene";
  auto* depth = app.add_option("--depth", arguments.depth, "16-bit depth image (PNG)")->group(group);
  auto* cloud =
      app.add_option("--cloud", arguments.cloud, "a cloud (.pcd, .ply) in the camera's frame instead")->group(group);
  auto* camera = app.add_option("--camera", arguments.camera,
                                "camera.json: fx, fy, cx, cy, width, height, depth_scale; for --depth and --cloud")
                     ->group(group);
  auto* view = app.add_option("--view", views,
                              "several images instead, each with depth.png camera.json pose.json; the pose is 4 x 4 "
                              "numbers, T_world_camera in a frame that all share")
                   ->group(group);
  auto* bop =
      app.add_option("--bop", arguments.bop, "a BOP dataset instead, such as dofusion-scan writes")->group(group);
  app.add_option("--scene", arguments.scene, "its scene")->check(CLI::NonNegativeNumber)->needs(bop)->group(group);
  app.add_option("--image", arguments.images, "its image; several are joined as --view does")
      ->check(CLI::NonNegativeNumber)
      ->needs(bop)
      ->group(group);
  app.add_option("--split", arguments.split, "its split; needed if several have the scene")->needs(bop)->group(group);
  auto* mask = app.add_option("--mask", arguments.mask,
                              "8-bit image: the objects' pixels, one value each, in place of our own segmentation")
                   ->group(group);
  depth->excludes(cloud, view, bop);
  cloud->excludes(view, bop);
  view->excludes(bop, camera, mask);
  bop->excludes(camera);
}

void add_object_options(CLI::App& app, PlaceArguments& arguments, bool& unknown) {
  const std::string group = "The objects";
  app.add_option("--query", arguments.query,
                 "a block (cube, rectangle, half_rectangle, tall_triangle, middle_triangle, "
                 "tetrahedron, hat) or a mesh file in metres")
      ->required()
      ->group(group);
  app.add_option("--query-unit", arguments.query_unit, "metres in a unit of the query's mesh: 0.001 for millimetres")
      ->check(CLI::PositiveNumber)
      ->group(group);
  auto* objects =
      app.add_option("--objects", arguments.objects, "folder of meshes: the objects on the table are among these")
          ->group(group);
  app.add_option("--objects-unit", arguments.objects_unit, "metres in a unit of those meshes")
      ->check(CLI::PositiveNumber)
      ->group(group);
  auto* models =
      app.add_flag("--bop-models", arguments.bop_models, "the objects are among the models of the BOP dataset")
          ->needs("--bop")
          ->excludes(objects)
          ->group(group);
  app.add_flag("--unknown", unknown, "nothing is known of the objects on the table (the default)")
      ->excludes(objects, models)
      ->group(group);
}

void add_sampling_options(CLI::App& app, PlaceArguments& arguments, bool& raw) {
  const std::string group = "Candidates";
  app.add_option("--samples", arguments.placement.samples, "candidate poses")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str()
      ->group(group);
  app.add_option("--steps", arguments.placement.steps, "reverse steps of the sampler")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str()
      ->group(group);
  auto* refine = app.add_option("--refine", arguments.refine,
                                "a file with a noisy T_camera_query or T_world_query (4 x 4, the frames of "
                                "placements.json): find the stable pose near it")
                     ->group(group);
  app.add_option("--refine-noise", arguments.refine_noise,
                 "how noisy: larger looks farther from the estimate; about its error over 50 mm")
      ->check(CLI::Range(0.005, 3.0))
      ->needs(refine)
      ->capture_default_str()
      ->group(group);
  app.add_flag("--raw", raw, "keep the model's poses; otherwise a stable one is replaced by where it came to rest")
      ->group(group);
  app.add_option("--model", arguments.model, "a model file; default: the shipped one")->group(group);
}

struct WishWords {
  std::vector<double> region, image_region;
  std::string on, upright;
  double clearance = 0.0;
};

void add_wish_options(CLI::App& app, WishWords& wishes) {
  const std::string group = "Wishes (exit status 3 if no stable placement meets them)";
  app.add_option("--region", wishes.region,
                 "x0 y0 x1 y1: the query's centre within this part of the table, metres, world")
      ->expected(4)
      ->group(group);
  app.add_option("--image-region", wishes.image_region, "u0 v0 u1 v1: within this part of the (first) image, pixels")
      ->expected(4)
      ->group(group);
  app.add_option("--on", wishes.on,
                 "table: it touches the table; a number: it rests on that object and not on the table")
      ->group(group);
  app.add_option("--clearance", wishes.clearance, "metres to every object that it does not touch")
      ->check(CLI::PositiveNumber)
      ->group(group);
  app.add_option("--upright", wishes.upright,
                 "x, y, z, -x, -y or -z of the query's mesh points up, to 10 degrees; z by itself")
      ->expected(0, 1)
      ->group(group);
}

Wishes to_wishes(const CLI::App& app, const WishWords& words) {
  Wishes wishes;
  const auto rectangle = [](const std::vector<double>& v) { return std::array<double, 4>{v[0], v[1], v[2], v[3]}; };
  if (!words.region.empty()) wishes.region = rectangle(words.region);
  if (!words.image_region.empty()) wishes.image_region = rectangle(words.image_region);
  if (app.count("--on") > 0) set_on(words.on, wishes);
  if (words.clearance > 0.0) wishes.clearance = words.clearance;
  if (app.count("--upright") > 0) wishes.upright = axis_from_string(words.upright.empty() ? "z" : words.upright);
  return wishes;
}

// What the parser cannot say in one line.
void check_arguments(PlaceArguments& arguments, const ViewWords& views) {
  if (arguments.depth.empty() && arguments.cloud.empty() && views.empty() && arguments.bop.empty())
    throw InputError("give --depth, --cloud, --view or --bop; see --help");
  if ((!arguments.depth.empty() || !arguments.cloud.empty()) && arguments.camera.empty())
    throw InputError("--camera is required with --depth and --cloud; see --help");
  if (!arguments.mask.empty() && arguments.images.size() > 1) throw InputError("--mask goes with a single image");
  for (const auto& [depth, camera, pose] : views) arguments.views.push_back({depth, camera, pose});
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{kDescription, "dofusion-place"};
  PlaceArguments arguments;
  ViewWords views;
  std::string out, json;
  bool unknown = false, raw = false;
  arguments.placement.threads = default_threads();
  add_image_options(app, arguments, views);
  add_object_options(app, arguments, unknown);
  add_sampling_options(app, arguments, raw);
  WishWords wishes;
  add_wish_options(app, wishes);
  bool found = true;
  app.add_option("--seed", arguments.placement.seed)->check(CLI::NonNegativeNumber)->capture_default_str();
  app.add_option("--threads", arguments.placement.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", json, "write placements.json here as well");
  app.add_option("--out", out, "folder for placements.json, scene.xml, report.html, …")->required();

  const int status = run_program(app, argc, argv, [&] {
    check_arguments(arguments, views);
    arguments.wishes = to_wishes(app, wishes);
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
    summary(summary_line(inputs, result) + "\nreport: " + out + "/report.html; all candidates: " + out +
            "/placements.json; the scene for MuJoCo: " + out + "/scene.xml\n");
    found = !arguments.wishes.any() || found_placement(result);
  });
  return status == 0 && !found ? kUnreachable : status;
}
