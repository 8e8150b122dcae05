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

// A label of one view.
struct ViewLabel {
  std::size_t view = 0;
  std::uint8_t label = 0;
  bool operator<(const ViewLabel& other) const {
    return std::make_pair(view, label) < std::make_pair(other.view, other.label);
  }
};
using LabelPoints = std::map<ViewLabel, std::vector<Eigen::Vector3d>>;

// Some of each label's readings, in the world.
LabelPoints thinned_points(const std::vector<View>& views) {
  LabelPoints points;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const View& view = views[i];
    for (int v = 0; v < view.depth.height; v += 3) {
      for (int u = 0; u < view.depth.width; u += 3) {
        const std::uint8_t label = view.labels.at(v, u);
        if (label < kLabelFirstObject || !is_valid_depth(view.depth.at(v, u))) continue;
        points[{i, label}].push_back(view.T_world_camera * unproject(view.camera, u, v, view.depth.at(v, u)));
      }
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
std::vector<std::vector<ViewLabel>> group_labels(const LabelPoints& points, double distance) {
  std::vector<std::vector<ViewLabel>> groups;
  for (const auto& [label, own] : points) {
    std::vector<ViewLabel> joined = {label};
    std::vector<std::vector<ViewLabel>> apart;
    for (std::vector<ViewLabel>& group : groups) {
      const bool near = std::any_of(group.begin(), group.end(), [&, &points_of_label = own](const ViewLabel& other) {
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

bool is_own(const std::vector<ViewLabel>& own, const ViewLabel& label) {
  return std::any_of(own.begin(), own.end(),
                     [&](const ViewLabel& other) { return other.view == label.view && other.label == label.label; });
}

// The pixels around a cluster in one view; empty if the view does not show it.
PixelWindow window_of(const View& view, std::size_t index, const LabelPoints& points,
                      const std::vector<ViewLabel>& own) {
  PixelWindow window{view.camera.width, view.camera.height, 0, 0, 1};
  const Pose T_camera_world = view.T_world_camera.inverse();
  for (int v = 0; v < view.labels.height; ++v) {
    for (int u = 0; u < view.labels.width; ++u) {
      if (!is_own(own, {index, view.labels.at(v, u)})) continue;
      window = {std::min(window.u0, u), std::min(window.v0, v), std::max(window.u1, u), std::max(window.v1, v), 1};
    }
  }
  for (const ViewLabel& label : own) {
    if (label.view == index) continue;  // what other views see
    for (const Eigen::Vector3d& p_world : points.at(label)) {
      const Eigen::Vector3d p = T_camera_world * p_world;
      if (p.z() < 0.01) continue;
      const Eigen::Vector2d pixel = project(view.camera, p);
      if (!(pixel.cwiseAbs().maxCoeff() < 1e6)) continue;
      const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
      window = {std::min(window.u0, u), std::min(window.v0, v), std::max(window.u1, u), std::max(window.v1, v), 1};
    }
  }
  window = {std::max(0, window.u0 - kWindowMargin), std::max(0, window.v0 - kWindowMargin),
            std::min(view.camera.width, window.u1 + 1 + kWindowMargin),
            std::min(view.camera.height, window.v1 + 1 + kWindowMargin), 1};
  const bool is_seen = window.u0 < window.u1 && window.v0 < window.v1;
  return is_seen ? window : PixelWindow{};
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

// What recovery computes once for a view.
struct PreparedView {
  DepthSigma sigma;
  FaceMap face_map;
};

PreparedView prepare(const View& view, const DepthSigma& prior) {
  const DepthSigma sigma = calibrate_sigma(view.depth, view.camera, table_of(view), prior);
  return {sigma, object_faces(view.depth, view.camera, view.labels, sigma)};
}

Cluster make_cluster(const std::vector<View>& views, const std::vector<PreparedView>& prepared,
                     const std::vector<ObjectModel>& models, const LabelPoints& points,
                     const std::vector<ViewLabel>& own) {
  Cluster cluster;
  const std::vector<Eigen::Vector3d>& nearby = points.at(own.front());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const View& view = views[i];
    ClusterView seen{&view.depth, &prepared[i].face_map, view.camera, view.T_world_camera, {}, {}};
    seen.window = window_of(view, i, points, own);
    for (const auto& [label, unused] : points) {
      if (label.view == i && !is_own(own, label)) seen.other_labels.push_back(label.label);
    }
    add_view(view.depth, view.camera, table_of(view), view.labels, seen.window, prepared[i].sigma,
             coarse_stride(models, view.camera, nearby, view.T_world_camera), seen.other_labels, cluster.pyramid);
    cluster.views.push_back(std::move(seen));
  }
  return cluster;
}

// The label that most of the pixels have in which the patch is the nearest surface of its scene.
int common_label(const Observation& seen, const ViewExplanation& others, const RasterPatch& patch) {
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

struct ExplainedReadings {
  int readings = 0, explained = 0;
};

// How many of a label's readings the scene explains to 3 sigma. Blocks can fill a part of a foreign object without
// contradicting any reading; what they leave gives them away.
ExplainedReadings explained_readings(const Observation& seen, const ViewExplanation& scene, int label) {
  ExplainedReadings count;
  for (std::size_t i = 0; i < seen.labels.pixels.size(); ++i) {
    if (seen.labels.pixels[i] != label || seen.depth.pixels[i] <= 0.0f) continue;
    ++count.readings;
    count.explained += scene.cost.pixels[i] < kExplainedCost;
  }
  return count;
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
    object.score = counts.explained / std::max(1.0, 0.0 + counts.explained + counts.behind);
    ExplainedReadings total;
    for (std::size_t k = 0; k < cluster.views.size(); ++k) {
      ViewScorer& view = scorer.views()[k];
      const int label =
          common_label(view.observation(), others[k], view.render(model.object->mesh, object.T_world_object));
      if (k == 0) object.label = label;
      if (label == 0) continue;
      const ExplainedReadings count = explained_readings(view.observation(), scene[k], label);
      total.readings += count.readings;
      total.explained += count.explained;
    }
    if (total.readings > 0) object.score *= static_cast<double>(total.explained) / total.readings;
    if (object.score < min_score) continue;
    result.push_back(object);
  }
  return result;
}

}  // namespace

std::vector<RecoveredObject> recover_known(const DepthImage& depth, const Camera& camera, const Table& table,
                                           const LabelImage& labels, const std::vector<ObjectPtr>& library,
                                           const KnownRecoveryOptions& options) {
  return recover_known({View{depth, camera, table.T_world_camera, labels}}, library, options);
}

std::vector<RecoveredObject> recover_known(const std::vector<View>& views, const std::vector<ObjectPtr>& library,
                                           const KnownRecoveryOptions& options) {
  if (views.empty()) throw std::invalid_argument("recover_known: no view");
  for (const View& view : views) {
    check_image_size(view.depth.width, view.depth.height, view.camera);
    check_image_size(view.labels.width, view.labels.height, view.camera);
  }
  if (library.empty()) throw std::invalid_argument("recover_known: the library has no object");
  const LabelPoints points = thinned_points(views);
  if (points.empty()) return {};
  std::vector<ObjectModel> models;
  for (const ObjectPtr& object : library) models.emplace_back(object);
  std::vector<PreparedView> prepared;
  for (const View& view : views) prepared.push_back(prepare(view, options.sigma));

  const SceneSearchOptions search = search_options(options);
  std::vector<RecoveredObject> recovered;
  for (const std::vector<ViewLabel>& own : group_labels(points, options.cluster_distance)) {
    const Cluster cluster = make_cluster(views, prepared, models, points, own);
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
