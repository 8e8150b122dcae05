#include "perception/sensor_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "perception/smooth_noise.h"

namespace dofusion {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180.0;

// First Kinect, in pixels times metres: disparity = kKinectFocalBaseline / depth (Handa et al. 2014).
constexpr double kKinectFocalBaseline = 585.5 * 0.075;

constexpr double kGrazingLimitDeg = 8.0;  // Handa et al. 2014
constexpr double kEdgeFly = 0.1;          // see sensor_terms

double clamp_probability(double p) { return std::min(std::max(p, 0.0), 1.0); }

// The noise of one image: its terms, scaled, and the draws.
class NoisyReader {
 public:
  NoisyReader(const Scan& scan, const Camera& camera, const SensorTerms& terms, double scale, Rng& rng)
      : scan_(scan), camera_(camera), terms_(terms), scale_(scale), rng_(rng) {
    const auto field = [&](double length) { return smooth_noise(camera.width, camera.height, length, rng); };
    if (terms.correlation_px > 0.0) {
      if (terms.axial_sigma) axial_ = field(terms.correlation_px);
      if (terms.lateral_sigma_px) right_ = field(terms.correlation_px), down_ = field(terms.correlation_px);
    }
    if (terms.warp_px > 0.0) warp_ = field(terms.warp_length_px);
    if (terms.hole_share > 0.0)
      holes_ = in_holes(camera.width, camera.height, scale * terms.hole_share, terms.hole_length_px, rng);
  }

  // The reading at a pixel, 0 for none.
  double read(int row, int column) {
    if (scan_.depth.at(row, column) <= 0.0f) return 0.0;
    if (!holes_.pixels.empty() && holes_.at(row, column)) return 0.0;
    const double incidence = incidence_angle(scan_, camera_, row, column);
    if (kPi / 2 - incidence < terms_.grazing_limit_deg * kDegree * std::min(scale_, 1.0)) return 0.0;
    if (happens(terms_.incidence_drop * (1.0 - std::cos(incidence)))) return 0.0;
    double depth = shifted_depth(row, column, incidence);
    if (const auto across = depth_across_edge(scan_, camera_, row, column)) {
      if (happens(terms_.edge_drop)) return 0.0;
      if (happens(terms_.edge_fly)) {
        if (*across <= 0.0) return 0.0;
        depth += (*across - depth) * uniform_(rng_);
      }
    }
    if (depth <= 0.0) return 0.0;
    if (terms_.axial_sigma) depth += scale_ * terms_.axial_sigma(depth, incidence) * draw(axial_, row, column);
    if (depth > 0.0 && !warp_.pixels.empty())
      depth = shift_disparity(depth, scale_ * terms_.warp_px * warp_.at(row, column));
    if (depth > 0.0 && terms_.disparity_step_px > 0.0)
      depth = quantise_disparity(depth, scale_ * terms_.disparity_step_px);
    return std::max(depth, 0.0);
  }

 private:
  bool happens(double probability) {
    return probability > 0.0 && uniform_(rng_) < clamp_probability(scale_ * probability);
  }

  // Standard normal: from the field, or a pixel's own.
  double draw(const Image<float>& field, int row, int column) {
    return field.pixels.empty() ? normal_(rng_) : field.at(row, column);
  }

  // The depth where the sensor looks instead of at the pixel's centre.
  double shifted_depth(int row, int column, double incidence) {
    if (!terms_.lateral_sigma_px) return scan_.depth.at(row, column);
    const double sigma = scale_ * terms_.lateral_sigma_px(incidence);
    const double u = std::clamp(column + sigma * draw(right_, row, column), 0.0, camera_.width - 1.0);
    const double v = std::clamp(row + sigma * draw(down_, row, column), 0.0, camera_.height - 1.0);
    return tangent_depth(scan_, camera_, static_cast<int>(std::lround(v)), static_cast<int>(std::lround(u)), u, v);
  }

  const Scan& scan_;
  const Camera& camera_;
  SensorTerms terms_;
  double scale_;
  Rng& rng_;
  Image<float> axial_, right_, down_, warp_;  // smooth noise; empty without the term
  Image<std::uint8_t> holes_;                 // empty without the term
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
};

}  // namespace

const std::vector<std::string>& sensor_names() {
  static const std::vector<std::string> names{"none", "kinect", "kinect2", "realsense", "azure"};
  return names;
}

std::string to_string(SensorModel sensor) { return sensor_names().at(static_cast<std::size_t>(sensor)); }

SensorModel sensor_from_string(const std::string& name) {
  const auto& names = sensor_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw std::invalid_argument("unknown sensor '" + name + "'; choose none, kinect, kinect2, realsense or azure");
  return static_cast<SensorModel>(found - names.begin());
}

SensorTerms sensor_terms(SensorModel sensor) {
  // Edge drop-outs are published for the two Kinects (7 % and 10.9 %). The others are assumed: the structured-light
  // figure for stereo, the time-of-flight figure for Azure. So is one flying pixel in ten edge pixels, of which the
  // sources say only that they lie anywhere inside the step.
  SensorTerms terms;
  if (sensor == SensorModel::kNone) return terms;
  terms.grazing_limit_deg = kGrazingLimitDeg;
  terms.edge_fly = kEdgeFly;
  switch (sensor) {
    case SensorModel::kNone:
      break;
    case SensorModel::kKinect:
      terms = published_kinect_terms();
      terms.axial_sigma = khoshelham_sigma;
      terms.lateral_sigma_px = handa_lateral_sigma_px;
      // Fitted to the real frames' scatter in windows of 5 to 21 pixels and to its correlation over 1 to 32 pixels
      // (sensor_calibration).
      terms.correlation_px = 1.6;
      terms.warp_px = 0.12;
      terms.warp_length_px = 40.0;
      return terms;
    case SensorModel::kKinect2:
      terms.axial_sigma = kinect2_axial_sigma;
      terms.edge_drop = 0.109;
      return terms;
    case SensorModel::kRealsense:
      terms.axial_sigma = realsense_sigma;
      terms.edge_drop = 0.07;
      return terms;
    case SensorModel::kAzure:
      terms.axial_sigma = azure_sigma;
      terms.lateral_sigma_px = azure_lateral_sigma_px;
      terms.edge_drop = 0.109;
      return terms;
  }
  return terms;
}

SensorTerms published_kinect_terms() {
  SensorTerms terms;
  terms.axial_sigma = kinect_axial_sigma;
  terms.lateral_sigma_px = kinect_lateral_sigma_px;
  terms.disparity_step_px = 0.125;
  terms.grazing_limit_deg = kGrazingLimitDeg;
  terms.edge_drop = 0.07;
  terms.edge_fly = kEdgeFly;
  return terms;
}

DepthImage apply_sensor_noise(const Scan& scan, const Camera& camera, SensorModel sensor, double noise_scale,
                              Rng& rng) {
  return apply_sensor_noise(scan, camera, sensor_terms(sensor), noise_scale, rng);
}

DepthImage apply_sensor_noise(const Scan& scan, const Camera& camera, const SensorTerms& terms, double noise_scale,
                              Rng& rng) {
  if (!(noise_scale >= 0.0) || !std::isfinite(noise_scale))
    throw std::invalid_argument("noise_scale must be 0 or more, not " + std::to_string(noise_scale));
  const auto fits = [&](const auto& image) { return image.width == camera.width && image.height == camera.height; };
  if (!fits(scan.depth) || !fits(scan.normals))
    throw std::invalid_argument("the scan must have depth and normals of the camera's size");
  if (noise_scale == 0.0) return scan.depth;
  DepthImage noisy(camera.width, camera.height);
  NoisyReader reader(scan, camera, terms, noise_scale, rng);
  for (int row = 0; row < camera.height; ++row)
    for (int column = 0; column < camera.width; ++column)
      noisy.at(row, column) = static_cast<float>(reader.read(row, column));
  return noisy;
}

double kinect_axial_sigma(double depth, double incidence) {
  const double frontal = 0.0012 + 0.0019 * (depth - 0.4) * (depth - 0.4);
  if (incidence <= kPi / 3) return frontal;
  const double from_grazing = kPi / 2 - incidence;
  return frontal + 0.0001 * incidence * incidence / (std::sqrt(depth) * from_grazing * from_grazing);
}

double khoshelham_sigma(double depth, double) { return 1.425e-3 * depth * depth; }

double khoshelham_depth_step(double depth) { return 2.85e-3 * depth * depth; }

double kinect2_axial_sigma(double depth, double incidence) {
  const double from_grazing = kPi / 2 - incidence;
  const double sigma_mm = 1.5 - 0.5 * depth + 0.3 * depth * depth +
                          0.1 * std::pow(depth, 1.5) * incidence * incidence / (from_grazing * from_grazing);
  return sigma_mm / 1000.0;
}

double realsense_sigma(double depth, double) {
  constexpr double kFocalPx = 0.5 * 848;  // 848 columns over 90 degrees
  constexpr double kBaseline = 0.050;     // metres
  constexpr double kSubpixel = 0.08;      // RMS of the disparity, pixels
  return depth * depth * kSubpixel / (kFocalPx * kBaseline);
}

double azure_sigma(double depth, double) { return 0.0005 + 0.001 * std::max(depth - 0.5, 0.0); }

double kinect_lateral_sigma_px(double incidence) { return 0.8 + 0.035 * incidence / (kPi / 2 - incidence); }

double handa_lateral_sigma_px(double) { return 0.5; }

double azure_lateral_sigma_px(double) { return 0.25; }

double shift_disparity(double depth, double error_px) {
  const double disparity = kKinectFocalBaseline / depth + error_px;
  return disparity > 0.0 ? kKinectFocalBaseline / disparity : 0.0;
}

Image<std::uint8_t> in_holes(int width, int height, double share, double length_px, Rng& rng) {
  const Image<float> noise = smooth_noise(width, height, length_px, rng);
  const double threshold = normal_exceedance(share);
  Image<std::uint8_t> holes(width, height);
  for (std::size_t i = 0; i < holes.pixels.size(); ++i) holes.pixels[i] = noise.pixels[i] > threshold ? 1 : 0;
  return holes;
}

double quantise_disparity(double depth, double step_px) {
  const double steps = std::round(kKinectFocalBaseline / depth / step_px);
  return steps > 0.0 ? kKinectFocalBaseline / (steps * step_px) : 0.0;
}

double tangent_depth(const Scan& scan, const Camera& camera, int row, int column, double u, double v) {
  const double depth = scan.depth.at(row, column);
  if (depth <= 0.0) return 0.0;
  const Eigen::Vector3d normal = scan.normals.at(row, column).cast<double>();
  const double here = normal.dot(unproject(camera, column, row, 1.0));
  const double there = normal.dot(unproject(camera, u, v, 1.0));
  // Where the plane turns edge-on between the two rays it says nothing about the surface.
  constexpr double kLargestRatio = 1.5;
  const double ratio = here / there;
  return ratio > 1.0 / kLargestRatio && ratio < kLargestRatio ? depth * ratio : depth;
}

std::optional<double> depth_across_edge(const Scan& scan, const Camera& camera, int row, int column) {
  constexpr std::array<std::array<int, 2>, 4> kNeighbours{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
  std::optional<double> across;
  double largest = kEdgeStep;
  for (const auto& [down, right] : kNeighbours) {
    const int r = row + down, c = column + right;
    if (!scan.depth.contains(r, c)) continue;
    const double neighbour = scan.depth.at(r, c);
    if (neighbour <= 0.0) {
      if (!across) across = 0.0;
      continue;
    }
    const double step = std::abs(neighbour - tangent_depth(scan, camera, row, column, c, r));
    if (step <= largest) continue;
    largest = step;
    across = neighbour;
  }
  return across;
}

double incidence_angle(const Scan& scan, const Camera& camera, int row, int column) {
  const Eigen::Vector3d ray = unproject(camera, column, row, 1.0).normalized();
  const double cosine = std::abs(ray.dot(scan.normals.at(row, column).cast<double>()));
  return std::acos(std::min(cosine, 1.0));
}

}  // namespace dofusion
