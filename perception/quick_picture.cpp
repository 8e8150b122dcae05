#include "perception/quick_picture.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace dofusion {
namespace {

constexpr double kGamma = 2.2;
constexpr double kAmbient = 0.25, kLamp = 0.6, kViewer = 0.15;  // shares of the light; 1 in all

class Light {
 public:
  explicit Light(const Pose& T_world_camera) {
    // To the left of the viewer and above the scene, whichever way the camera leans.
    const Eigen::Vector3d left = -T_world_camera.linear().col(0), back = -T_world_camera.linear().col(2);
    const Eigen::Vector3d lamp_world = (0.65 * left + 0.25 * back + 1.1 * Eigen::Vector3d::UnitZ()).normalized();
    lamp_ = (T_world_camera.linear().transpose() * lamp_world).cast<float>();
  }

  // Of a surface with this normal in the camera's frame.
  double on(const Eigen::Vector3f& normal) const {
    return kAmbient + kLamp * std::max(0.0f, normal.dot(lamp_)) + kViewer * std::max(0.0f, -normal.z());
  }

 private:
  Eigen::Vector3f lamp_;
};

Rgb lit(const Rgb& colour, double light) {
  const double factor = std::pow(light, 1.0 / kGamma);
  Rgb result;
  for (std::size_t k = 0; k < 3; ++k) result[k] = static_cast<std::uint8_t>(std::lround(colour[k] * factor));
  return result;
}

// `things` says what is seen, `nothing` where there is none; own(thing) is a thing's colour in full light.
template <class Thing, class Own>
ColourImage lit_picture(const Image<Thing>& things, Thing nothing, const NormalImage& normals,
                        const Pose& T_world_camera, const Own& own) {
  const Light light(T_world_camera);
  ColourImage picture(things.width, things.height, kTableColour);
  // Neighbours mostly lie on one face.
  Thing thing = nothing;
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  Rgb colour = kTableColour;
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
    if (things.pixels[i] == nothing) continue;
    if (things.pixels[i] != thing || normals.pixels[i] != normal) {
      thing = things.pixels[i];
      normal = normals.pixels[i];
      colour = lit(own(thing), light.on(normal));
    }
    picture.pixels[i] = colour;
  }
  return picture;
}

}  // namespace

ColourImage quick_picture(const Scan& scan, const Pose& T_world_camera) {
  return lit_picture(scan.labels, kLabelNothing, scan.normals, T_world_camera, [](std::uint8_t label) {
    return label == kLabelTable ? kTableColour : object_colour(label - kLabelFirstObject);
  });
}

ColourImage quick_picture(const GeomScan& scan, const std::vector<Geom>& geoms, const Pose& T_world_camera) {
  return lit_picture(scan.geoms, std::int32_t{-1}, scan.normals, T_world_camera,
                     [&](std::int32_t geom) { return drawn_rgb(geoms[static_cast<std::size_t>(geom)]); });
}

}  // namespace dofusion
