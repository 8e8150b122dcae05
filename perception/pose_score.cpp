#include "perception/pose_score.h"

#include <algorithm>
#include <cmath>

namespace dofusion {
namespace {

constexpr float kNoTable = 1e3f;  // metres; depth of a pixel whose ray misses the table
constexpr double kFloor = 2e-4;      // metres; no mesh and no pose is better than this, however exact the sensor

float table_depth(const Camera& camera, const Pose& T_world_camera, double u, double v) {
  const double fall = (T_world_camera.linear() * unproject(camera, u, v, 1.0)).z();
  if (fall >= 0.0) return kNoTable;
  return static_cast<float>(std::min<double>(kNoTable, -T_world_camera.translation().z() / fall));
}

// What the readings cost under a surface of the given depth and facing; scalars and Eigen's arrays alike. `zero`
// tells them apart.
template <class T>
auto reading_cost(const T& reading, const T& missing, const T& precision, const T& scene, const T& facing) {
  using std::max;
  using std::min;
  const T difference = reading - scene;
  const T behind = max(difference, 0.0f), nearer = min(difference, 0.0f);
  const T faces_camera = min(max((facing - kGrazingCosine) / (kFacingCosine - kGrazingCosine), 0.0f), 1.0f);
  return T(min(T(behind * behind * precision), kBehindCost) + min(T(nearer * nearer * precision), kNearerCost) +
           missing * faces_camera * kMissingCost);
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
  seen.precision = Image<float>(seen.camera.width, seen.camera.height, 0.0f);
  seen.background = DepthImage(seen.camera.width, seen.camera.height, kNoTable);
  seen.labels = LabelImage(seen.camera.width, seen.camera.height, kLabelNothing);
  for (int row = 0; row < seen.camera.height; ++row) {
    for (int column = 0; column < seen.camera.width; ++column) {
      const int v = window.v0 + row * window.stride, u = window.u0 + column * window.stride;
      const float z = depth.at(v, u);
      seen.depth.at(row, column) = is_valid_depth(z) ? z : 0.0f;
      const double sigma = sigma_of(seen.depth.at(row, column)) + kFloor;
      seen.precision.at(row, column) = static_cast<float>(0.5 / (sigma * sigma));
      seen.background.at(row, column) = table_depth(camera, table.T_world_camera, u, v);
      seen.labels.at(row, column) = labels.at(v, u);
    }
  }
  return seen;
}

double total_cost(const Explanation& explanation) {
  double sum = 0.0;
  for (const float cost : explanation.cost.pixels) sum += cost;
  return sum;
}

Explanation PoseScorer::empty_scene() const {
  Explanation scene;
  scene.depth = observation_->background;
  scene.cost = Image<float>(scene.depth.width, scene.depth.height);
  for (std::size_t i = 0; i < scene.depth.pixels.size(); ++i) {
    scene.cost.pixels[i] =
        reading_cost(observation_->depth.pixels[i], scene.depth.pixels[i], observation_->precision.pixels[i],
                     observation_->table_facing);
  }
  return scene;
}

void PoseScorer::add(const TriangleMesh& mesh, const Pose& T_world_object, Explanation& scene) {
  const RasterPatch& patch = render(mesh, T_world_object);
  for (int row = 0; row < patch.height; ++row) {
    for (int column = 0; column < patch.width; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * patch.width + column;
      const float w = patch.inverse_depth[i];
      const int v = patch.v0 + row, u = patch.u0 + column;
      if (w <= 0.0f || 1.0f / w >= scene.depth.at(v, u)) continue;
      scene.depth.at(v, u) = 1.0f / w;
      scene.cost.at(v, u) = reading_cost(observation_->depth.at(v, u), 1.0f / w, observation_->precision.at(v, u),
                                         patch.facing[patch.face[i]]);
    }
  }
}

double PoseScorer::gain(const Explanation& scene, const TriangleMesh& mesh, const Pose& T_world_object) {
  const RasterPatch& patch = render(mesh, T_world_object);
  double sum = 0.0;
  for (int row = 0; row < patch.height; ++row) {
    const std::size_t in_patch = static_cast<std::size_t>(row) * patch.width;
    const std::size_t in_scene = static_cast<std::size_t>(patch.v0 + row) * scene.depth.width + patch.u0;
    const float* inverse_depth = &patch.inverse_depth[in_patch];
    const std::int32_t* face = &patch.face[in_patch];
    const float* scene_depth = &scene.depth.pixels[in_scene];
    const float* scene_cost = &scene.cost.pixels[in_scene];
    const float* reading = &observation_->depth.pixels[in_scene];
    const float* precision = &observation_->precision.pixels[in_scene];
    float row_sum = 0.0f;
    for (int i = 0; i < patch.width; ++i) {
      const float w = inverse_depth[i];
      const float cost = reading_cost(reading[i], 1.0f / std::max(w, 1e-6f), precision[i], patch.facing[face[i]]);
      row_sum += w * scene_depth[i] > 1.0f ? scene_cost[i] - cost : 0.0f;
    }
    sum += row_sum;
  }
  return sum;
}

PixelCounts PoseScorer::count(const Explanation& scene, const TriangleMesh& mesh, const Pose& T_world_object) {
  const RasterPatch& patch = render(mesh, T_world_object);
  PixelCounts counts;
  for (int row = 0; row < patch.height; ++row) {
    for (int column = 0; column < patch.width; ++column) {
      const float w = patch.inverse_depth[static_cast<std::size_t>(row) * patch.width + column];
      const int v = patch.v0 + row, u = patch.u0 + column;
      if (w <= 0.0f || 1.0f / w >= scene.depth.at(v, u)) continue;
      const float reading = observation_->depth.at(v, u);
      const float difference = reading - 1.0f / w;
      if (reading <= 0.0f) {
        ++counts.missing;
      } else if (difference * difference * observation_->precision.at(v, u) < 4.5f) {
        ++counts.explained;
      } else {
        ++(difference < 0.0f ? counts.nearer : counts.behind);
      }
    }
  }
  return counts;
}

}  // namespace dofusion
