#include "perception/scene_scanner.h"

#include <algorithm>
#include <stdexcept>

#include "perception/geom_rays.h"
#include "perception/geom_scanner.h"
#include "perception/quick_picture.h"
#include "perception/synthetic_view.h"

namespace dofusion {
namespace {

ScannerOptions without_table() {
  ScannerOptions options;
  options.table = false;
  return options;
}

class SolidScanner : public SceneScanner {
 public:
  explicit SolidScanner(const Scene& scene) : scene_(scene), all_(scene.objects) {
    all_.set_poses(scene.T_world_object);
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
      alone_.emplace_back(std::vector<ObjectPtr>{scene.objects[i]}, without_table());
      alone_.back().set_poses({scene.T_world_object[i]});
    }
  }

  Shot shoot(const Camera& camera, const Pose& T_world_camera, bool fine) const override {
    Shot shot;
    all_.render(camera, T_world_camera, shot.scan);
    shot.picture = fine ? shaded_picture(all_, camera, T_world_camera) : quick_picture(shot.scan, T_world_camera);
    return shot;
  }

  LabelImage silhouette(int object, const Camera& camera, const Pose& T_world_camera,
                        const PixelWindow& window) const override {
    return alone_.at(static_cast<std::size_t>(object))
        .render_window(camera, T_world_camera, window.u0, window.v0, window.u1, window.v1)
        .labels;
  }

  std::string viewpoint_problem(const Pose& T_world_camera) const override {
    return dofusion::viewpoint_problem(scene_, T_world_camera);
  }

 private:
  Scene scene_;
  Scanner all_;
  std::vector<Scanner> alone_;  // per object, without anything that could hide it
};

GeomScannerOptions all_groups() {
  GeomScannerOptions options;
  options.groups.fill(true);
  return options;
}

GeomScanner posed_scanner(std::vector<Geom> geoms, const std::vector<Pose>& T_world_body) {
  GeomScanner scanner(std::move(geoms), all_groups());
  scanner.set_poses(T_world_body);
  return scanner;
}

// Of a geom that has an inside. On its surface counts: rays from there hit it or not as rounding has it.
bool is_inside(const Geom& geom, const Eigen::Vector3d& p_geom) {
  constexpr double kSkin = 1e-6;  // metres
  switch (geom.type) {
    case GeomType::kMesh:
      return encloses(*geom.mesh, p_geom);
    case GeomType::kHeightField:
      return encloses(height_field_mesh(*geom.height_field), p_geom);
    default:
      return contains(geom.type, geom.size + Eigen::Vector3d::Constant(kSkin), p_geom);
  }
}

class GeomSceneScanner : public SceneScanner {
 public:
  explicit GeomSceneScanner(const GeomScene& scene) : scene_(scene), all_(make_all(scene)) {
    const auto objects = std::max_element(scene.object_of_body.begin(), scene.object_of_body.end());
    const int count = objects == scene.object_of_body.end() ? 0 : *objects + 1;
    for (int object = 0; object < count; ++object) {
      std::vector<Geom> own;
      std::copy_if(scene.geoms.begin(), scene.geoms.end(), std::back_inserter(own),
                   [&](const Geom& geom) { return scene.object_of_body[body_of(geom)] == object; });
      alone_.push_back(posed_scanner(std::move(own), scene.T_world_body));
    }
    for (const int object : scene.object_of_body) {
      labels_.push_back(object < 0 ? kLabelTable : static_cast<std::uint8_t>(kLabelFirstObject + object));
    }
  }

  Shot shoot(const Camera& camera, const Pose& T_world_camera, bool fine) const override {
    const GeomScan scan = all_.render(camera, T_world_camera);
    return {labelled(scan, labels_),
            fine ? shaded_picture(all_, camera, T_world_camera) : quick_picture(scan, all_.geoms(), T_world_camera)};
  }

  LabelImage silhouette(int object, const Camera& camera, const Pose& T_world_camera,
                        const PixelWindow& window) const override {
    LabelImage result(window.u1 - window.u0, window.v1 - window.v0);
    // In strips: a window may be nine images large, and a scan has much more to a pixel than its label.
    constexpr int kStrip = 256;  // rows
    for (int row0 = 0; row0 < result.height; row0 += kStrip) {
      Camera part = camera;
      part.width = result.width;
      part.height = std::min(kStrip, result.height - row0);
      part.cx -= window.u0;
      part.cy -= window.v0 + row0;
      const GeomScan scan = alone_.at(static_cast<std::size_t>(object)).render(part, T_world_camera);
      std::transform(scan.bodies.pixels.begin(), scan.bodies.pixels.end(),
                     result.pixels.begin() + static_cast<std::ptrdiff_t>(row0) * result.width,
                     [](std::int32_t body) { return body < 0 ? kLabelNothing : kLabelFirstObject; });
    }
    return result;
  }

  std::string viewpoint_problem(const Pose& T_world_camera) const override {
    const Eigen::Vector3d eye = T_world_camera.translation();
    for (const Geom& geom : scene_.geoms) {
      const std::size_t body = body_of(geom);
      const Eigen::Vector3d p_geom = (scene_.T_world_body[body] * geom.T_body_geom).inverse() * eye;
      if (geom.type == GeomType::kPlane) {
        if (!(p_geom.z() > 0.0)) return "the camera is behind a plane";
        continue;
      }
      if (!is_inside(geom, p_geom)) continue;
      const int object = scene_.object_of_body[body];
      return "the camera is inside " +
             (object < 0 ? "'" + scene_.body_names[body] + "', which does not move"
                         : "object " + std::to_string(object) + " (" + scene_.body_names[body] + ")");
    }
    return "";
  }

 private:
  static std::size_t body_of(const Geom& geom) { return static_cast<std::size_t>(geom.body); }

  static GeomScanner make_all(const GeomScene& scene) {
    if (scene.object_of_body.size() != scene.T_world_body.size() ||
        scene.body_names.size() != scene.T_world_body.size())
      throw std::invalid_argument("every body needs a pose, a name and what object it is");
    return posed_scanner(scene.geoms, scene.T_world_body);
  }

  GeomScene scene_;
  GeomScanner all_;
  std::vector<GeomScanner> alone_;    // per object, as above
  std::vector<std::uint8_t> labels_;  // per body
};

}  // namespace

std::unique_ptr<SceneScanner> make_scene_scanner(const Scene& scene) { return std::make_unique<SolidScanner>(scene); }

std::unique_ptr<SceneScanner> make_scene_scanner(const GeomScene& scene) {
  return std::make_unique<GeomSceneScanner>(scene);
}

}  // namespace dofusion
