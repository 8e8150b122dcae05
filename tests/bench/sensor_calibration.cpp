// The Kinect model against real frames: how much the readings of a table scatter, measured in the same way.
//
//   sensor_calibration --real ../shared/real/mosd --seed 1     DIR holds camera.json, learn<N>_depth.png and
//                                                              learn<N>_label.png; the model sees each frame's table
//   sensor_calibration --seed 1                                the model alone, on tables seen at 46 to 56 degrees

#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "perception/depth_io.h"
#include "perception/plane_noise.h"
#include "perception/sensor_noise.h"
#include "perception/table.h"
#include "stability/files.h"

namespace {

using namespace dofusion;

constexpr int kFrames = 45;
constexpr int kWindows[] = {5, 7, 11, 15, 21};
constexpr int kLags[] = {1, 2, 4, 8, 16, 32};  // pixels along a row

// What is measured of one source of images.
struct Source {
  std::string name;
  std::vector<std::vector<NoiseBin>> bins;  // per window
  std::vector<double> products, squares;    // per lag, of the disparity's deviations from the table
  double warp = 0.0;                        // sigmas, mean over the frames; see measure_warp
  int frames = 0;
};

std::vector<double> table_distances() {
  std::vector<double> distances;
  for (const TableNoise& row : kKinectTableNoise) distances.push_back(row.distance);
  return distances;
}

Source make_source(const std::string& name) {
  return {name, std::vector<std::vector<NoiseBin>>(std::size(kWindows), noise_bins(table_distances())),
          std::vector<double>(std::size(kLags)), std::vector<double>(std::size(kLags))};
}

void add_correlation(const DepthImage& depth, const LabelImage& labels, const Camera& camera, const Table& table,
                     Source& source) {
  const InversePlane plane = table_plane(table);
  const auto deviation = [&](int v, int u) { return 1.0 / depth.at(v, u) - plane.dot(pixel_ray(camera, u, v)); };
  const auto on_table = [&](int v, int u) {
    return labels.at(v, u) == kLabelTable && is_valid_depth(depth.at(v, u)) && std::abs(deviation(v, u)) < 0.011;
  };
  for (std::size_t k = 0; k < std::size(kLags); ++k) {
    for (int v = 0; v < depth.height; ++v) {
      for (int u = 0; u + kLags[k] < depth.width; ++u) {
        if (!on_table(v, u) || !on_table(v, u + kLags[k])) continue;
        source.products[k] += deviation(v, u) * deviation(v, u + kLags[k]);
        source.squares[k] += deviation(v, u) * deviation(v, u);
      }
    }
  }
}

void add_frame(const DepthImage& depth, const LabelImage& labels, const Camera& camera, Source& source) {
  for (std::size_t w = 0; w < std::size(kWindows); ++w) {
    PlaneNoiseOptions options;
    options.window = kWindows[w];
    add_plane_noise(depth, labels, source.bins[w], options);
  }
  const std::optional<Table> table = find_table(depth, camera);
  if (!table) throw std::runtime_error("no table in a frame");
  source.warp += measure_warp(depth, camera, *table, DepthSigma{});
  source.frames += 1;
  add_correlation(depth, labels, camera, *table, source);
}

void print(const Source& source) {
  std::printf("%s, %d frames: sigma in mm (windows of N pixels)\n", source.name.c_str(), source.frames);
  for (std::size_t w = 0; w < std::size(kWindows); ++w) {
    std::printf("  %2d px ", kWindows[w]);
    for (const NoiseBin& bin : source.bins[w]) std::printf("  %.2f m %.2f", bin.distance, 1000.0 * bin.sigma());
    std::printf("\n");
  }
  std::printf("  correlation at");
  for (std::size_t k = 0; k < std::size(kLags); ++k) {
    std::printf("  %d px %.2f", kLags[k], source.products[k] / source.squares[k]);
  }
  std::printf("; warp %.2f sigmas\n", source.warp / source.frames);
}

// Against the reference, in windows of 11 pixels.
void print_ratios(const Source& source) {
  std::printf("%s over the reference: ", source.name.c_str());
  for (std::size_t k = 0; k < kKinectTableNoise.size(); ++k) {
    std::printf("  %.2f m %.2f", kKinectTableNoise[k].distance, source.bins[2][k].sigma() / kKinectTableNoise[k].sigma);
  }
  std::printf("\n");
}

DepthImage model_of(const Scan& scan, const Camera& camera, const SensorTerms& terms, std::uint64_t seed, int frame) {
  Rng rng = make_rng(seed, static_cast<std::uint64_t>(frame));
  DepthImage depth = apply_sensor_noise(scan, camera, terms, 1.0, rng);
  for (float& z : depth.pixels) z = std::round(1000.0F * z) / 1000.0F;  // as the frames are stored
  return depth;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Scatter of table readings: real frames, the Kinect model, and the model as published");
  std::string real;
  std::uint64_t seed = 1;
  SensorTerms terms = sensor_terms(SensorModel::kKinect);
  app.add_option("--real", real, "folder of real frames (mOSD)");
  app.add_option("--seed", seed, "of the model's noise");
  app.add_option("--correlation", terms.correlation_px, "of the model, pixels");
  app.add_option("--warp", terms.warp_px, "of the model, pixels of disparity");
  app.add_option("--warp-length", terms.warp_length_px, "of the model, pixels");
  CLI11_PARSE(app, argc, argv);
  try {
    Source frames = make_source("real frames"), model = make_source("Kinect model"),
           published = make_source("as published (Nguyen)");
    const Scanner scanner({});
    Camera camera{525.0, 525.0, 319.5, 239.5, 640, 480, 1.0};
    if (!real.empty()) camera = read_camera(real + "/camera.json");
    for (int n = 0; n < kFrames; ++n) {
      const double elevation = (34.0 + 10.0 * n / (kFrames - 1)) * 3.14159265358979323846 / 180.0;
      Pose T_world_camera =
          look_at(0.85 * Eigen::Vector3d(std::cos(elevation), 0.0, std::sin(elevation)), Eigen::Vector3d::Zero());
      LabelImage labels(camera.width, camera.height, kLabelTable);
      if (!real.empty()) {
        const std::string stem = real + "/learn" + std::to_string(n);
        const DepthImage depth = read_depth(stem + "_depth.png", camera);
        labels = read_labels(stem + "_label.png", camera);
        add_frame(depth, labels, camera, frames);
        T_world_camera = find_table(depth, camera)->T_world_camera;
      }
      const Scan scan = scanner.render(camera, T_world_camera);
      add_frame(model_of(scan, camera, terms, seed, n), labels, camera, model);
      add_frame(model_of(scan, camera, published_kinect_terms(), seed, n), labels, camera, published);
    }
    for (const Source* source : {&frames, &model, &published}) {
      if (source->frames > 0) print(*source);
    }
    std::printf("reference (11 px):");
    for (const TableNoise& row : kKinectTableNoise) std::printf("  %.2f m %.2f", row.distance, 1000.0 * row.sigma);
    std::printf("\n");
    for (const Source* source : {&frames, &model, &published}) {
      if (source->frames > 0) print_ratios(*source);
    }
  } catch (const dofusion::InputError& e) {
    std::fprintf(stderr, "sensor_calibration: %s\n", e.what());
    return 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "sensor_calibration: %s\n", e.what());
    return 1;
  }
  return 0;
}
