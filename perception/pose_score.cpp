#include "perception/pose_score.h"

#include <algorithm>
#include <cmath>

namespace dofusion {
namespace {

constexpr float kNoTable = 1e3f;    // metres; depth of a pixel whose ray misses the table
constexpr float kNoReading = 1e6f;  // variance that makes every difference count nothing

float table_depth(const Camera& camera, const Pose& T_world_camera, double u, double v) {
  const double fall = (T_world_camera.linear() * unproject(camera, u, v, 1.0)).z();
  if (fall >= 0.0) return kNoTable;
  return static_cast<float>(std::min<double>(kNoTable, -T_world_camera.translation().z() / fall));
}

// N pixels side by side: Eigen takes vector registers for them on every compiler.
template <int N>
using Pixels = Eigen::Array<float, N, 1>;

template <int N>
Pixels<N> load(const float* values) {
  return Eigen::Map<const Pixels<N>>(values);
}

// What readings cost under a surface at the depth `scene` that faces the camera by the cosine `facing`.
template <int N>
Pixels<N> reading_cost(const Pixels<N>& reading, const Pixels<N>& missing, const Pixels<N>& variance,
                       const Pixels<N>& scene, const Pixels<N>& facing) {
  const Pixels<N> behind = (reading - scene).max(0.0f), nearer = (reading - scene).min(0.0f);
  const Pixels<N> faces_camera =
      ((facing - kGrazingCosine) * (1.0f / (kFacingCosine - kGrazingCosine))).max(0.0f).min(1.0f);
  // A surface that is off by kExactness across itself is off by so much more along a grazing ray.
  const Pixels<N> off = kExactness * facing.max(0.01f).inverse();
  const Pixels<N> precision = (2.0f * (variance + off * off)).inverse();
  return (behind * behind * precision).min(kBehindCost) + (nearer * nearer * precision).min(kNearerCost) +
         missing * faces_camera * kMissingCost;
}

float reading_cost_at(const Observation& seen, std::size_t pixel, float scene, float facing) {
  using One = Pixels<1>;
  return reading_cost<1>(One(seen.depth.pixels[pixel]), One(seen.missing.pixels[pixel]),
                         One(seen.variance.pixels[pixel]), One(scene), One(facing))[0];
}

float table_cost_at(const Observation& seen, std::size_t pixel) {
  return reading_cost_at(seen, pixel, seen.background.pixels[pixel], seen.table_facing);
}

// By how much N pixels of a patch lower the cost of the scene; 0 where the scene is nearer.
template <int N>
Pixels<N> gain_of_pixels(const Observation& seen, const ViewExplanation& scene, std::size_t in_scene,
                         const RasterPatch& patch, std::size_t in_patch) {
  const Pixels<N> w = load<N>(&patch.inverse_depth[in_patch]);
  const Pixels<N> nearest = ((w * load<N>(&scene.depth.pixels[in_scene]) - 1.0f) * 1e7f).max(0.0f).min(1.0f);
  const Pixels<N> cost = reading_cost<N>(load<N>(&seen.depth.pixels[in_scene]), load<N>(&seen.missing.pixels[in_scene]),
                                         load<N>(&seen.variance.pixels[in_scene]), w.max(1e-6f).inverse(),
                                         load<N>(&patch.facing[in_patch]));
  return nearest * (load<N>(&scene.cost.pixels[in_scene]) - cost);
}

// Cosine between the ray to the window's middle and the table's normal.
float table_facing_at(const Camera& camera, const Pose& T_world_camera) {
  const Eigen::Vector3d ray = pixel_ray(camera, 0.5 * camera.width, 0.5 * camera.height);
  return static_cast<float>(-(T_world_camera.linear() * ray).z() / ray.norm());
}

}  // namespace

Observation observe(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
                    const PixelWindow& window, const DepthSigma& sigma_of) {
  Observation seen;
  seen.camera = camera;
  seen.camera.width = (window.u1 - window.u0 + window.stride - 1) / window.stride;
  seen.camera.height = (window.v1 - window.v0 + window.stride - 1) / window.stride;
  seen.camera.fx = camera.fx / window.stride;
  seen.camera.fy = camera.fy / window.stride;
  seen.camera.cx = (camera.cx - window.u0) / window.stride;
  seen.camera.cy = (camera.cy - window.v0) / window.stride;
  seen.T_camera_world = table.T_world_camera.inverse();
  seen.table_facing = table_facing_at(seen.camera, table.T_world_camera);
  seen.depth = DepthImage(seen.camera.width, seen.camera.height, 0.0f);
  seen.variance = Image<float>(seen.camera.width, seen.camera.height, kNoReading);
  seen.missing = Image<float>(seen.camera.width, seen.camera.height, 1.0f);
  seen.background = DepthImage(seen.camera.width, seen.camera.height, kNoTable);
  seen.labels = LabelImage(seen.camera.width, seen.camera.height, kLabelNothing);
  std::vector<double> sigmas;
  for (int row = 0; row < seen.camera.height; ++row) {
    for (int column = 0; column < seen.camera.width; ++column) {
      const int v = window.v0 + row * window.stride, u = window.u0 + column * window.stride;
      const float z = depth.at(v, u);
      seen.depth.at(row, column) = is_valid_depth(z) ? z : 0.0f;
      if (seen.depth.at(row, column) > 0.0f) {
        const double sigma = sigma_of(z);
        seen.variance.at(row, column) = static_cast<float>(sigma * sigma);
        seen.missing.at(row, column) = 0.0f;
        sigmas.push_back(sigma);
      }
      seen.background.at(row, column) = table_depth(camera, table.T_world_camera, u, v);
      seen.labels.at(row, column) = labels.at(v, u);
    }
  }
  if (!sigmas.empty()) {
    std::nth_element(sigmas.begin(), sigmas.begin() + sigmas.size() / 2, sigmas.end());
    seen.sigma = sigmas[sigmas.size() / 2];
  }
  seen.table_cost = Image<float>(seen.camera.width, seen.camera.height);
  for (std::size_t i = 0; i < seen.table_cost.pixels.size(); ++i) seen.table_cost.pixels[i] = table_cost_at(seen, i);
  return seen;
}

void ignore_labels(const std::vector<std::uint8_t>& labels, Observation& observation) {
  for (std::size_t i = 0; i < observation.labels.pixels.size(); ++i) {
    if (std::find(labels.begin(), labels.end(), observation.labels.pixels[i]) == labels.end()) continue;
    observation.depth.pixels[i] = 0.0f;
    observation.variance.pixels[i] = kNoReading;
    observation.missing.pixels[i] = 0.0f;
    observation.table_cost.pixels[i] = table_cost_at(observation, i);
  }
}

double total_cost(const Explanation& explanation) {
  double sum = 0.0;
  for (const ViewExplanation& view : explanation) {
    for (const float cost : view.cost.pixels) sum += cost;
  }
  return sum;
}

PixelCounts& PixelCounts::operator+=(const PixelCounts& other) {
  explained += other.explained;
  nearer += other.nearer;
  behind += other.behind;
  missing += other.missing;
  return *this;
}

ViewExplanation ViewScorer::empty_scene() const { return {observation_->background, observation_->table_cost}; }

void ViewScorer::add(const TriangleMesh& mesh, const Pose& T_world_object, ViewExplanation& scene) {
  const RasterPatch& patch = render(mesh, T_world_object);
  for (int row = 0; row < patch.height; ++row) {
    for (int column = 0; column < patch.width; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * patch.width + column;
      const float w = patch.inverse_depth[i];
      const std::size_t pixel = static_cast<std::size_t>(patch.v0 + row) * scene.depth.width + patch.u0 + column;
      if (w <= 0.0f || 1.0f / w >= scene.depth.pixels[pixel]) continue;
      scene.depth.pixels[pixel] = 1.0f / w;
      scene.cost.pixels[pixel] = reading_cost_at(*observation_, pixel, 1.0f / w, patch.facing[i]);
    }
  }
}

double ViewScorer::gain(const ViewExplanation& scene, const TriangleMesh& mesh, const Pose& T_world_object) {
  constexpr int kSideBySide = 8;
  const RasterPatch& patch = render(mesh, T_world_object);
  Pixels<kSideBySide> sums = Pixels<kSideBySide>::Zero();
  for (int row = 0; row < patch.height; ++row) {
    const std::size_t in_patch = static_cast<std::size_t>(row) * patch.width;
    const std::size_t in_scene = static_cast<std::size_t>(patch.v0 + row) * scene.depth.width + patch.u0;
    int i = 0;
    for (; i + kSideBySide <= patch.width; i += kSideBySide) {
      sums += gain_of_pixels<kSideBySide>(*observation_, scene, in_scene + i, patch, in_patch + i);
    }
    for (; i < patch.width; ++i) {
      sums[0] += gain_of_pixels<1>(*observation_, scene, in_scene + i, patch, in_patch + i)[0];
    }
  }
  return sums.cast<double>().sum();
}

PixelCounts ViewScorer::count(const ViewExplanation& scene, const TriangleMesh& mesh, const Pose& T_world_object) {
  const RasterPatch& patch = render(mesh, T_world_object);
  PixelCounts counts;
  for (int row = 0; row < patch.height; ++row) {
    for (int column = 0; column < patch.width; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * patch.width + column;
      const std::size_t pixel = static_cast<std::size_t>(patch.v0 + row) * scene.depth.width + patch.u0 + column;
      const float w = patch.inverse_depth[i];
      if (w <= 0.0f || 1.0f / w >= scene.depth.pixels[pixel]) continue;
      const float reading = observation_->depth.pixels[pixel];
      if (reading <= 0.0f) {
        ++counts.missing;
      } else if (reading_cost_at(*observation_, pixel, 1.0f / w, patch.facing[i]) < kExplainedCost) {
        ++counts.explained;
      } else {
        ++(reading < 1.0f / w ? counts.nearer : counts.behind);
      }
    }
  }
  return counts;
}

Explanation PoseScorer::empty_scene() const {
  Explanation scene;
  for (const ViewScorer& view : views_) scene.push_back(view.empty_scene());
  return scene;
}

void PoseScorer::add(const TriangleMesh& mesh, const Pose& T_world_object, Explanation& scene) {
  for (std::size_t i = 0; i < views_.size(); ++i) views_[i].add(mesh, T_world_object, scene[i]);
}

double PoseScorer::gain(const Explanation& scene, const TriangleMesh& mesh, const Pose& T_world_object) {
  double sum = 0.0;
  for (std::size_t i = 0; i < views_.size(); ++i) sum += views_[i].gain(scene[i], mesh, T_world_object);
  return sum;
}

PixelCounts PoseScorer::count(const Explanation& scene, const TriangleMesh& mesh, const Pose& T_world_object) {
  PixelCounts counts;
  for (std::size_t i = 0; i < views_.size(); ++i) counts += views_[i].count(scene[i], mesh, T_world_object);
  return counts;
}

double PoseScorer::sigma() const {
  double largest = 0.0;
  for (const ViewScorer& view : views_) largest = std::max(largest, view.observation().sigma);
  return largest;
}

}  // namespace dofusion
