#include "apps/place_scene.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "perception/known_recovery.h"
#include "perception/picture.h"
#include "perception/seen_surface.h"

namespace dofusion {
namespace {

constexpr std::size_t kMostPoints = 20000;  // of all readings: 0.4 MB in the page
constexpr double kMostPixels = 640 * 480;   // of a view that are looked at for them
constexpr double kTableMargin = 0.12;       // metres of table around the objects
constexpr double kMostAside = 0.6;          // metres of table beyond that for what rolls away
constexpr double kMostHeight = 1.0;         // metres above the table; readings beyond are of something else
constexpr float kSeenShare = 0.1f;          // of a face's area; from there on it counts as seen

Rgb mixed(const Rgb& a, const Rgb& b, double share_of_b) {
  Rgb colour;
  for (int k = 0; k < 3; ++k) {
    colour[k] = static_cast<std::uint8_t>(std::lround((1.0 - share_of_b) * a[k] + share_of_b * b[k]));
  }
  return colour;
}

std::vector<Eigen::Vector3f> in_single_precision(const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3f> result;
  for (const Eigen::Vector3d& p : points) result.push_back(p.cast<float>());
  return result;
}

// The part of the table that objects and placements stand on, with a margin.
Eigen::AlignedBox2d stage(const PlaceInputs& inputs, const PlaceResult& result) {
  Eigen::AlignedBox2d box;
  const auto include = [&](const Object& object, const Pose& T_world_object) {
    for (const Eigen::Vector3d& v : object.mesh.vertices) box.extend((T_world_object * v).head<2>().eval());
  };
  const Scene& scene = result.recovered.scene;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) include(*scene.objects[i], scene.T_world_object[i]);
  for (const Placement& placement : result.placements) {
    if (placement.stable) include(*inputs.query, placement.T_world_query);
  }
  if (!result.placements.empty()) include(*inputs.query, result.placements.front().T_world_query);
  if (box.isEmpty()) box.extend(Eigen::Vector2d::Zero());
  return {box.min().array() - kTableMargin, box.max().array() + kTableMargin};
}

// The stage and where things go while they settle, as far as is worth showing: the table of physics has no end.
GltfMesh table_mesh(const Eigen::AlignedBox2d& stage, const std::vector<SettlingMotion>& motions,
                    std::size_t material) {
  Eigen::AlignedBox2d box = stage;
  const Eigen::AlignedBox2d most(stage.min().array() - kMostAside, stage.max().array() + kMostAside);
  for (const SettlingMotion& motion : motions) {
    for (const Pose& pose : motion.T_world_object.back()) {
      box.extend((pose.translation().head<2>().array() - kTableMargin).matrix().eval());
      box.extend((pose.translation().head<2>().array() + kTableMargin).matrix().eval());
    }
  }
  box = box.intersection(most);
  GltfMesh mesh;
  for (const auto& [x, y] : {std::pair(box.min().x(), box.min().y()), std::pair(box.max().x(), box.min().y()),
                             std::pair(box.max().x(), box.max().y()), std::pair(box.min().x(), box.max().y())}) {
    mesh.vertices.emplace_back(static_cast<float>(x), static_cast<float>(y), 0.0f);
  }
  mesh.faces.push_back({{{0, 1, 2}, {0, 2, 3}}, material});
  return mesh;
}

// A view's valid readings above the stage, in their objects' colours; of large images, those of a coarser grid of
// pixels.
void add_readings(const View& view, const LabelImage& labels, const Eigen::AlignedBox2d& box, GltfMesh& mesh) {
  const double pixels = static_cast<double>(view.depth.width) * view.depth.height;
  const int stride = static_cast<int>(std::ceil(std::sqrt(pixels / kMostPixels)));
  for (int v = 0; v < view.depth.height; v += stride) {
    for (int u = 0; u < view.depth.width; u += stride) {
      const double z = view.depth.at(v, u);
      if (!(z > 0.0) || !std::isfinite(z)) continue;
      const Eigen::Vector3d p = view.T_world_camera * unproject(view.camera, u, v, z);
      if (!box.contains(p.head<2>().eval()) || std::abs(p.z()) > kMostHeight) continue;
      const int label = labels.at(v, u);
      const Rgb colour = label < kLabelFirstObject ? kTableColour : object_colour(label - kLabelFirstObject);
      mesh.vertices.push_back(p.cast<float>());
      mesh.colours.push_back(mixed(colour, {0, 0, 0}, 0.5));  // darker than the surfaces that they lie on
    }
  }
}

// The readings of all views, thinned out evenly.
GltfMesh observed_mesh(const RecoveredScene& recovered, const Eigen::AlignedBox2d& box, std::size_t material) {
  GltfMesh all;
  for (const View& view : recovered.views) {
    const bool first = &view == &recovered.views.front();
    add_readings(view,
                 first ? recovered.labels
                       : label_recovered(view.depth, view.camera, table_of(view), view.labels, recovered.objects),
                 box, all);
  }
  GltfMesh thinned;
  thinned.point_material = material;
  const std::size_t step = (all.vertices.size() + kMostPoints - 1) / kMostPoints;
  for (std::size_t i = 0; i < all.vertices.size(); i += step) {
    thinned.vertices.push_back(all.vertices[i]);
    thinned.colours.push_back(all.colours[i]);
  }
  return thinned;
}

class Builder {
 public:
  Builder(const PlaceInputs& inputs, const PlaceResult& result) : inputs_(inputs), result_(result) {}

  GltfScene build(const std::vector<SettlingMotion>& motions) {
    const Eigen::AlignedBox2d box = stage(inputs_, result_);
    scene_.nodes.push_back({"table", Pose::Identity(), table_mesh(box, motions, add_material("table", kTableColour))});
    for (std::size_t i = 0; i < result_.recovered.objects.size(); ++i) add_object(i);
    if (!result_.placements.empty()) add_query();
    const std::size_t of_points = add_material("observed", {255, 255, 255}, false);
    scene_.nodes.push_back({"observed", Pose::Identity(), observed_mesh(result_.recovered, box, of_points)});
    for (std::size_t k = 0; k < motions.size(); ++k) add_motion("rank " + std::to_string(k + 1), motions[k]);
    const Camera& camera = inputs_.camera;
    scene_.camera = GltfCamera{"depth camera", result_.recovered.table->T_world_camera,
                               2.0 * std::atan(0.5 * camera.height / camera.fy),
                               (camera.width * camera.fy) / (camera.height * camera.fx)};
    return std::move(scene_);
  }

 private:
  std::size_t add_material(const std::string& name, const Rgb& colour, bool lit = true) {
    scene_.materials.push_back({name, colour, lit});
    return scene_.materials.size() - 1;
  }

  void add_object(std::size_t i) {
    const RecoveredObject& object = result_.recovered.objects[i];
    const std::string name = "object " + std::to_string(i) + (object.known ? ": " + object.name : "");
    const Rgb colour = object_colour(static_cast<int>(i));
    GltfFaces seen{{}, add_material(name, colour)}, unseen;
    const std::vector<Eigen::Vector3i>& triangles = object.object->mesh.triangles;
    const std::vector<float> shares = shown_shares(object);
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      (shares[t] >= kSeenShare ? seen : unseen).triangles.push_back(triangles[t]);
    }
    GltfMesh mesh{in_single_precision(object.object->mesh.vertices), {}, {}, 0};
    if (!seen.triangles.empty()) mesh.faces.push_back(seen);
    if (!unseen.triangles.empty()) {
      unseen.material = add_material(name + " (not seen)", mixed(colour, {255, 255, 255}, 0.55));
      mesh.faces.push_back(unseen);
    }
    movable_.push_back(scene_.nodes.size());
    scene_.nodes.push_back({name, object.T_world_object, mesh});
  }

  // Per triangle; of a known object all is known, seen or not.
  std::vector<float> shown_shares(const RecoveredObject& object) {
    if (object.known) return std::vector<float>(object.object->mesh.triangles.size(), 1.0f);
    if (views_.empty()) {
      views_.push_back(
          {inputs_.depth, inputs_.camera, result_.recovered.table->T_world_camera, result_.recovered.labels});
    }
    return seen_shares(object, views_);
  }

  void add_query() {
    const std::string name = "query: " + inputs_.query->name;
    GltfMesh mesh{in_single_precision(inputs_.query->mesh.vertices),
                  {},
                  {{inputs_.query->mesh.triangles, add_material(name, kQueryColour)}},
                  0};
    movable_.push_back(scene_.nodes.size());
    scene_.nodes.push_back({name, result_.placements.front().T_world_query, mesh});
  }

  void add_motion(const std::string& name, const SettlingMotion& motion) {
    GltfAnimation animation{name, {motion.seconds.begin(), motion.seconds.end()}, movable_, {}};
    for (std::size_t k = 0; k < movable_.size(); ++k) {
      animation.T_world_node.emplace_back();
      for (const std::vector<Pose>& poses : motion.T_world_object) animation.T_world_node.back().push_back(poses[k]);
    }
    scene_.animations.push_back(std::move(animation));
  }

  const PlaceInputs& inputs_;
  const PlaceResult& result_;
  std::vector<View> views_;           // made when first needed
  std::vector<std::size_t> movable_;  // nodes of the objects, then of the query: the order of settling
  GltfScene scene_;
};

}  // namespace

GltfScene place_scene(const PlaceInputs& inputs, const PlaceResult& result,
                      const std::vector<SettlingMotion>& motions) {
  return result.recovered.table ? Builder(inputs, result).build(motions) : GltfScene{};
}

std::string scene_glb(const PlaceInputs& inputs, const PlaceResult& result, const PlacementOptions& options) {
  return to_glb(place_scene(
      inputs, result,
      settling_motions(result.recovered.scene, inputs.query, result.placements, options.physics, options.threads)));
}

}  // namespace dofusion
