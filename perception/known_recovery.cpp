#include "perception/known_recovery.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "perception/scene_search.h"
#include "perception/settled_scene.h"

namespace dofusion {
namespace {

constexpr int kWindowMargin = 24;        // pixels around a cluster: free space that must stay free
constexpr float kSameSurface = 0.01f;    // metres between a reading and the object it shows
constexpr double kCoarsePixels = 100.0;  // of the library's smallest object on the coarse level, about

SceneSearchOptions search_options(const KnownRecoveryOptions& options) {
  SceneSearchOptions search;
  search.threads = std::max(1, options.threads);
  search.beam = std::max(1, options.beam);
  search.fewest_pixels = options.fewest_pixels;
  return search;
}

// Some of each label's readings, in the world.
std::map<int, std::vector<Eigen::Vector3d>> thinned_points(const DepthImage& depth, const Camera& camera,
                                                           const Pose& T_world_camera, const LabelImage& labels) {
  std::map<int, std::vector<Eigen::Vector3d>> points;
  for (int v = 0; v < depth.height; v += 3) {
    for (int u = 0; u < depth.width; u += 3) {
      const int label = labels.at(v, u);
      if (label < kLabelFirstObject || !is_valid_depth(depth.at(v, u))) continue;
      points[label].push_back(T_world_camera * unproject(camera, u, v, depth.at(v, u)));
    }
  }
  return points;
}

bool within(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b, double distance) {
  for (const Eigen::Vector3d& p : a) {
    for (const Eigen::Vector3d& q : b) {
      if ((p - q).squaredNorm() < distance * distance) return true;
    }
  }
  return false;
}

// Labels whose readings come near each other, directly or through others.
std::vector<std::vector<std::uint8_t>> group_labels(const std::map<int, std::vector<Eigen::Vector3d>>& points,
                                                    double distance) {
  std::vector<std::vector<std::uint8_t>> groups;
  for (const auto& [label, own] : points) {
    std::vector<std::uint8_t> joined = {static_cast<std::uint8_t>(label)};
    std::vector<std::vector<std::uint8_t>> apart;
    for (std::vector<std::uint8_t>& group : groups) {
      const bool near = std::any_of(group.begin(), group.end(), [&, &points_of_label = own](std::uint8_t other) {
        return within(points_of_label, points.at(other), distance);
      });
      if (near) {
        joined.insert(joined.end(), group.begin(), group.end());
      } else {
        apart.push_back(std::move(group));
      }
    }
    apart.push_back(std::move(joined));
    groups = std::move(apart);
  }
  return groups;
}

PixelWindow window_of(const LabelImage& labels, const std::vector<std::uint8_t>& own) {
  PixelWindow window{labels.width, labels.height, 0, 0, 1};
  for (int v = 0; v < labels.height; ++v) {
    for (int u = 0; u < labels.width; ++u) {
      if (std::find(own.begin(), own.end(), labels.at(v, u)) == own.end()) continue;
      window = {std::min(window.u0, u), std::min(window.v0, v), std::max(window.u1, u), std::max(window.v1, v), 1};
    }
  }
  return {std::max(0, window.u0 - kWindowMargin), std::max(0, window.v0 - kWindowMargin),
          std::min(labels.width, window.u1 + 1 + kWindowMargin), std::min(labels.height, window.v1 + 1 + kWindowMargin),
          1};
}

// All of a cluster but its faces and its pyramid.
Cluster make_cluster(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
                     const std::map<int, std::vector<Eigen::Vector3d>>& points, const std::vector<std::uint8_t>& own) {
  Cluster cluster;
  cluster.depth = &depth;
  cluster.camera = camera;
  cluster.T_world_camera = table.T_world_camera;
  cluster.window = window_of(labels, own);
  for (const auto& [label, unused] : points) {
    const bool is_own = std::find(own.begin(), own.end(), label) != own.end();
    if (!is_own) cluster.other_labels.push_back(static_cast<std::uint8_t>(label));
  }
  return cluster;
}

// So coarse that a typical object of the library still covers some hundred pixels.
int coarse_stride(const std::vector<ObjectModel>& models, const Camera& camera,
                  const std::vector<Eigen::Vector3d>& points, const Pose& T_world_camera) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) centre += point / static_cast<double>(points.size());
  const double z = std::max(0.05, (T_world_camera.inverse() * centre).z());
  double volume = models.front().object->volume;
  for (const ObjectModel& model : models) volume = std::min(volume, model.object->volume);
  const double side_px = std::cbrt(volume) * camera.fx / z;
  return std::clamp(static_cast<int>(std::lround(side_px / std::sqrt(kCoarsePixels))), 1, 8);
}

FaceMap object_faces(const DepthImage& depth, const Camera& camera, const LabelImage& labels, const DepthSigma& sigma) {
  Image<std::uint8_t> mask(labels.width, labels.height, 0);
  for (std::size_t i = 0; i < mask.pixels.size(); ++i) mask.pixels[i] = labels.pixels[i] >= kLabelFirstObject;
  FaceOptions options;
  options.sigma = sigma;
  return find_faces(depth, camera, mask, {}, options);
}

// The label that most of the pixels have in which the patch is the nearest surface of its scene.
int common_label(const Observation& seen, const Explanation& others, const RasterPatch& patch) {
  std::vector<int> votes(256, 0);
  for (int row = 0; row < patch.height; ++row) {
    for (int column = 0; column < patch.width; ++column) {
      const float w = patch.inverse_depth[static_cast<std::size_t>(row) * patch.width + column];
      const int v = patch.v0 + row, u = patch.u0 + column;
      const int label = seen.labels.at(v, u);
      if (w * others.depth.at(v, u) > 1.0f && label >= kLabelFirstObject) ++votes[label];
    }
  }
  return static_cast<int>(std::max_element(votes.begin(), votes.end()) - votes.begin());
}

// Share of a label's readings that the scene explains to 3 sigma. Blocks can fill a part of a foreign object without
// contradicting any reading; what they leave gives them away.
double explained_share(const Observation& seen, const Explanation& scene, int label) {
  int readings = 0, explained = 0;
  for (std::size_t i = 0; i < seen.labels.pixels.size(); ++i) {
    if (seen.labels.pixels[i] != label || seen.depth.pixels[i] <= 0.0f) continue;
    ++readings;
    explained += scene.cost.pixels[i] < kExplainedCost;
  }
  return explained / std::max(1.0, 0.0 + readings);
}

// The recovered objects of a cluster's scene, those that explain too little left out.
std::vector<RecoveredObject> report(const std::vector<ObjectModel>& models, const Cluster& cluster,
                                    const std::vector<PlacedObject>& objects, double min_score) {
  PoseScorer scorer(cluster.pyramid.fine);
  Explanation scene = scorer.empty_scene();
  for (const PlacedObject& object : objects) {
    scorer.add(models[object.model].object->mesh, object.T_world_object, scene);
  }
  std::vector<RecoveredObject> result;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    Explanation others = scorer.empty_scene();
    for (std::size_t j = 0; j < objects.size(); ++j) {
      if (j != i) scorer.add(models[objects[j].model].object->mesh, objects[j].T_world_object, others);
    }
    const ObjectModel& model = models[objects[i].model];
    const PixelCounts counts = scorer.count(others, model.object->mesh, objects[i].T_world_object);
    RecoveredObject object;
    object.object = model.object;
    object.T_world_object = objects[i].T_world_object;
    object.name = model.object->name;
    object.known = true;
    object.pixels = counts.explained;
    object.label = common_label(scorer.observation(), others, scorer.render(model.object->mesh, object.T_world_object));
    object.score = counts.explained / std::max(1.0, 0.0 + counts.explained + counts.behind);
    if (object.label > 0) object.score *= explained_share(cluster.pyramid.fine, scene, object.label);
    if (object.score < min_score) continue;
    result.push_back(object);
  }
  return result;
}

}  // namespace

std::vector<RecoveredObject> recover_known(const DepthImage& depth, const Camera& camera, const Table& table,
                                           const LabelImage& labels, const std::vector<ObjectPtr>& library,
                                           const KnownRecoveryOptions& options) {
  check_image_size(depth.width, depth.height, camera);
  check_image_size(labels.width, labels.height, camera);
  if (library.empty()) throw std::invalid_argument("recover_known: the library has no object");
  const auto points = thinned_points(depth, camera, table.T_world_camera, labels);
  if (points.empty()) return {};
  std::vector<ObjectModel> models;
  for (const ObjectPtr& object : library) models.emplace_back(object);

  const DepthSigma sigma = calibrate_sigma(depth, camera, table, options.sigma);
  const FaceMap face_map = object_faces(depth, camera, labels, sigma);
  const SceneSearchOptions search = search_options(options);
  std::vector<RecoveredObject> recovered;
  for (const std::vector<std::uint8_t>& own : group_labels(points, options.cluster_distance)) {
    Cluster cluster = make_cluster(depth, camera, table, labels, points, own);
    cluster.face_map = &face_map;
    cluster.pyramid = observe_pyramid(depth, camera, table, labels, cluster.window, sigma,
                                      coarse_stride(models, camera, points.at(own.front()), table.T_world_camera));
    for (Observation* level : {&cluster.pyramid.coarse, &cluster.pyramid.medium, &cluster.pyramid.fine}) {
      ignore_labels(cluster.other_labels, *level);
    }
    const std::vector<SceneHypothesis> scenes = search_scenes(models, cluster, search);
    const SceneHypothesis chosen = options.settle ? choose_settled(models, cluster, scenes, search.costs,
                                                                   {options.settle_distance, options.settle_angle})
                                                  : scenes.front();
    for (RecoveredObject& object : report(models, cluster, chosen.objects, options.min_score)) {
      recovered.push_back(std::move(object));
    }
  }
  std::stable_sort(recovered.begin(), recovered.end(), [](const RecoveredObject& a, const RecoveredObject& b) {
    return std::make_pair(a.label, -a.pixels) < std::make_pair(b.label, -b.pixels);
  });
  return recovered;
}

LabelImage label_recovered(const DepthImage& depth, const Camera& camera, const Table& table, const LabelImage& labels,
                           const std::vector<RecoveredObject>& objects) {
  check_image_size(depth.width, depth.height, camera);
  check_image_size(labels.width, labels.height, camera);
  LabelImage result = labels;
  for (std::uint8_t& label : result.pixels) label = label >= kLabelFirstObject ? kLabelNothing : label;
  Image<float> nearest(depth.width, depth.height, 0.0f);  // inverse depth
  DepthRaster raster(camera);
  const Pose T_camera_world = table.T_world_camera.inverse();
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const RasterPatch& patch = raster.render(objects[i].object->mesh, T_camera_world * objects[i].T_world_object);
    for (int row = 0; row < patch.height; ++row) {
      for (int column = 0; column < patch.width; ++column) {
        const float w = patch.inverse_depth[static_cast<std::size_t>(row) * patch.width + column];
        const int v = patch.v0 + row, u = patch.u0 + column;
        if (w <= nearest.at(v, u)) continue;
        nearest.at(v, u) = w;
        const bool agrees = std::abs(depth.at(v, u) - 1.0f / w) < kSameSurface;
        if (!agrees || labels.at(v, u) == kLabelTable) continue;
        result.at(v, u) = static_cast<std::uint8_t>(std::min<std::size_t>(255, kLabelFirstObject + i));
      }
    }
  }
  return result;
}

}  // namespace dofusion
