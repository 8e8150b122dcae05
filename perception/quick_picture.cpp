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

}  // namespace

ColourImage quick_picture(const Scan& scan, const Pose& T_world_camera) {
  const Light light(T_world_camera);
  ColourImage picture(scan.labels.width, scan.labels.height, kTableColour);
  // Neighbours mostly lie on one face.
  std::uint8_t label = kLabelNothing;
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  Rgb colour = kTableColour;
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
    if (scan.labels.pixels[i] == kLabelNothing) continue;
    if (scan.labels.pixels[i] != label || scan.normals.pixels[i] != normal) {
      label = scan.labels.pixels[i];
      normal = scan.normals.pixels[i];
      const Rgb own = label == kLabelTable ? kTableColour : object_colour(label - kLabelFirstObject);
      colour = lit(own, light.on(normal));
    }
    picture.pixels[i] = colour;
  }
  return picture;
}

}  // namespace dofusion
