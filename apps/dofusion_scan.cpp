// Synthetic depth scans of stable scenes, to a dataset in BOP's layout.
#include <cstdio>
#include <vector>

#include "apps/program.h"
#include "apps/scan_job.h"
#include "perception/picture.h"
#include "stability/files.h"

using namespace dofusion;

namespace {

Camera camera_of(const std::vector<int>& size) {
  Camera camera = default_camera();
  camera = resized(camera, static_cast<double>(size[0]) / camera.width);
  camera.height = size[1];
  camera.cy = (size[1] - 1) / 2.0;
  return camera;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Scans stable scenes with a synthetic depth camera and writes a dataset that the BOP toolkit reads: depth, "
      "colour, "
      "masks, poses, models with their symmetries. It works in OUT.partial, which becomes OUT at the end; after a kill "
      "the same command goes on where it was.\n\nExamples:\n"
      "  dofusion-scan --task unstructured --objects 3 --count 100 --out scans\n"
      "  dofusion-scan --data scenes.h5 --data-split test --cameras 5 --sensor kinect --out scans\n"
      "  dofusion-scan --mjcf kitchen.xml --settle --camera all --out kitchen\n"
      "  dofusion-scan --count 20 --sensor none --pcd --fine-rgb --out exact\n"
      "  dofusion-scan --count 20 --cameras 3 --pose-error 0.5 3 --out badly_calibrated",
      "dofusion-scan"};
  ScanJob job;
  job.threads = default_threads();
  std::string task = "unstructured", shapes = "blocks", sensor = "realsense", json;
  std::vector<int> size{job.camera.width, job.camera.height};
  std::vector<double> pose_error{0.0, 0.0};
  auto* data = app.add_option("--data", job.data, "scenes of this dataset (HDF5, of dofusion-generate)");
  app.add_option("--data-split", job.data_split, "only the dataset's scenes of train, validation or test")->needs(data);
  auto* mjcf =
      app.add_option("--mjcf", job.mjcf.file, "or this MuJoCo scene: what moves in it are the objects")->excludes(data);
  app.add_option("--keyframe", job.mjcf.keyframe, "name or number of the MuJoCo file's keyframe to start from")
      ->needs(mjcf);
  app.add_flag("--settle", job.mjcf.settle, "let the MuJoCo scene come to rest first")->needs(mjcf);
  auto* camera = app.add_option("--camera", job.mjcf.cameras, "look from these cameras of the MuJoCo file, or from all")
                     ->needs(mjcf);
  app.add_option("--task", task, "or new scenes: single, unstructured or stack")
      ->capture_default_str()
      ->excludes(data)
      ->excludes(mjcf);
  app.add_option("--objects", job.generation.objects, "objects in a new scene, 1 to 6 (1 for single)")
      ->capture_default_str()
      ->excludes(data)
      ->excludes(mjcf);
  app.add_option("--shapes", shapes, "of new scenes: blocks or general")
      ->capture_default_str()
      ->excludes(data)
      ->excludes(mjcf);
  app.add_option("--count", job.count, "scenes; 0: all of the dataset, or 10 new ones")
      ->check(CLI::Range(0, 1'000'000))
      ->excludes(mjcf);
  app.add_option("--cameras", job.cameras, "viewpoints a scene")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str()
      ->excludes(camera);
  app.add_option("--sensor", sensor, "none, kinect, kinect2, realsense or azure")->capture_default_str();
  app.add_option("--noise-scale", job.view.noise_scale, "multiplies the sensor's noise, and --pose-error")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--pose-error", pose_error,
                 "a miscalibrated camera: degrees about each of its axes and millimetres along each axis (standard "
                 "deviations) between its pose in scene_camera.json and the one that the image is taken from")
      ->expected(2)
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  app.add_option("--distance", job.distance,
                 "from the camera to the objects' centre, metres; default: 0.7, or what the size of the MuJoCo scene's "
                 "objects asks for")
      ->check(CLI::Range(0.05, 1000.0))
      ->excludes(camera);
  app.add_option("--size", size, "width and height in pixels; the field of view stays")
      ->expected(2)
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  app.add_option("--split", job.split, "name of the folder of scenes")->capture_default_str();
  app.add_flag("--fine-rgb", job.fine_rgb, "colour pictures with soft shadows; about ten times as slow");
  app.add_flag("--pcd", job.clouds, "each depth image as a PCD file too: organised, camera frame, metres");
  app.add_option("--seed", job.seed, "the same seed gives the same dataset on any number of threads")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--threads", job.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--json", json, "write what was done to this file, images a second included");
  app.add_option("--out", job.out, "the dataset's folder; it must not be there yet")->required();

  return run_program(app, argc, argv, [&] {
    job.view.sensor = sensor_from_string(sensor);
    job.view.miscalibration.rotation_deg = pose_error[0];
    job.view.miscalibration.translation = pose_error[1] / 1000.0;
    job.camera = camera_of(size);
    job.generation.task = task_from_string(task);
    if (job.generation.task == Task::kSingle) job.generation.objects = 1;
    job.generation.shapes = shape_family_from_string(shapes);
    const bool is_name = !job.split.empty() && job.split.front() != '.' && job.split.find('/') == std::string::npos &&
                         job.split != "models";
    if (!is_name) throw InputError("--split: '" + job.split + "' is no name for a folder of scenes");
    if (!json.empty()) check_writable(json);
    const ScanResult result = scan_scenes(job);
    if (!json.empty()) write_file(json, to_json(job, result).dump(2) + "\n");
    char rate[32];
    std::snprintf(rate, sizeof rate, "%.1f", result.images_per_second);
    summary(job.out + ": " + std::to_string(result.images) + " images of " + std::to_string(result.scenes) +
            " scenes, " + std::to_string(result.models) + " models, " + rate +
            " images/s\nnext: dofusion-place --bop " + job.out + " --scene 0 --image 0 …\n");
  });
}
