#include "perception/picture.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <utility>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "perception/png.h"
#include "stability/files.h"

namespace dofusion {
namespace {

constexpr std::array<Rgb, 10> kPalette{{{66, 120, 190},
                                        {84, 166, 92},
                                        {148, 103, 189},
                                        {222, 190, 60},
                                        {60, 175, 180},
                                        {200, 90, 120},
                                        {140, 110, 85},
                                        {120, 150, 60},
                                        {100, 110, 140},
                                        {225, 150, 190}}};
constexpr Rgb kNoReading{0, 0, 0};
constexpr Rgb kUnlabelled{90, 90, 95};

Rgb label_colour(std::uint8_t label, bool reading) {
  if (label == kLabelNothing) return reading ? kUnlabelled : kNoReading;
  return label == kLabelTable ? kTableColour : object_colour(label - kLabelFirstObject);
}

Rgb scaled_colour(const Rgb& colour, double factor) {
  Rgb result;
  for (int k = 0; k < 3; ++k)
    result[k] = static_cast<std::uint8_t>(std::clamp(std::lround(colour[k] * factor), 0L, 255L));
  return result;
}

// Google's Turbo colour map (Mikhailov 2019) by its polynomial approximation; t in [0, 1].
Rgb turbo(double t) {
  const auto polynomial = [t](std::array<double, 6> c) {
    double value = 0.0;
    for (int k = 5; k >= 0; --k) value = value * t + c[k];
    return static_cast<std::uint8_t>(std::clamp(std::lround(255.0 * value), 0L, 255L));
  };
  return {polynomial({0.13572138, 4.61539260, -42.66032258, 132.13108234, -152.94239396, 59.28637943}),
          polynomial({0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604}),
          polynomial({0.10667330, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973})};
}

constexpr double kSameSurface = 0.02;  // metres between neighbours; more is another surface

// Every reading's mean with its neighbours on the same surface, first along rows, then along columns.
DepthImage smoothed(const DepthImage& depth) {
  constexpr int kReach = 4;  // pixels
  DepthImage source = depth, result = depth;
  for (const auto& [down, right] : {std::pair(0, 1), std::pair(1, 0)}) {
    for (int row = 0; row < depth.height; ++row)
      for (int column = 0; column < depth.width; ++column) {
        const float here = source.at(row, column);
        float sum = 0.0f;
        int count = 0;
        for (int k = -kReach; k <= kReach; ++k) {
          const int r = row + k * down, c = column + k * right;
          if (!source.contains(r, c) || std::abs(source.at(r, c) - here) > kSameSurface) continue;
          sum += source.at(r, c);
          ++count;
        }
        result.at(row, column) = here > 0.0f ? sum / static_cast<float>(count) : 0.0f;
      }
    source = result;
  }
  return result;
}

// Shading in [0, 1] by a light at the camera of the surface seen at a pixel.
double headlight(const DepthImage& depth, const Camera& camera, int row, int column) {
  constexpr int kReach = 3;  // pixels
  constexpr double kUnknown = 0.8;
  // From one to the other side of the pixel, as far as they are on its surface.
  const auto difference = [&](int down, int right) -> Eigen::Vector3d {
    const auto end = [&](int sign) {
      int r = row + sign * down, c = column + sign * right;
      const bool same = depth.contains(r, c) && std::abs(depth.at(r, c) - depth.at(row, column)) < kSameSurface;
      if (!same) r = row, c = column;
      return unproject(camera, c, r, depth.at(r, c));
    };
    return end(1) - end(-1);
  };
  const Eigen::Vector3d normal = difference(0, kReach).cross(difference(kReach, 0));
  if (normal.isZero(1e-12)) return kUnknown;
  return std::abs(normal.normalized().dot(unproject(camera, column, row, 1.0).normalized()));
}

}  // namespace

Rgb object_colour(int index) {
  const Rgb colour = kPalette[static_cast<std::size_t>(index) % kPalette.size()];
  // Later rounds of the palette are darker.
  return scaled_colour(colour, std::pow(0.8, static_cast<double>(index / static_cast<int>(kPalette.size()))));
}

Rgb drawn_rgb(const Geom& geom) {
  Rgb rgb;
  for (std::size_t k = 0; k < 3; ++k) {
    rgb[k] = static_cast<std::uint8_t>(std::lround(255.0f * std::clamp(geom.rgba[k], 0.0f, 1.0f)));
  }
  return rgb;
}

ColourImage depth_picture(const DepthImage& depth) {
  ColourImage picture(depth.width, depth.height, kNoReading);
  std::vector<float> readings;
  std::copy_if(depth.pixels.begin(), depth.pixels.end(), std::back_inserter(readings), [](float z) { return z > 0; });
  if (readings.empty()) return picture;
  const auto percentile = [&](double share) {
    const auto at = readings.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(readings.size() - 1));
    std::nth_element(readings.begin(), at, readings.end());
    return static_cast<double>(*at);
  };
  const double near = percentile(0.01), far = percentile(0.99);
  const double range = std::max(far - near, 1e-6);
  for (std::size_t i = 0; i < depth.pixels.size(); ++i) {
    // The map's ends are nearly black.
    constexpr double kDarkEnds = 0.06;
    const double t = std::clamp((far - depth.pixels[i]) / range, 0.0, 1.0);
    if (depth.pixels[i] > 0.0f) picture.pixels[i] = turbo(kDarkEnds + (1.0 - 2.0 * kDarkEnds) * t);
  }
  return picture;
}

ColourImage segmentation_picture(const LabelImage& labels, const DepthImage& depth, const Camera& camera) {
  if (labels.width != depth.width || labels.height != depth.height)
    throw std::invalid_argument("labels of " + std::to_string(labels.width) + "x" + std::to_string(labels.height) +
                                " pixels for a depth image of " + std::to_string(depth.width) + "x" +
                                std::to_string(depth.height));
  constexpr double kAmbient = 0.35;
  const DepthImage smooth = smoothed(depth);
  ColourImage picture(labels.width, labels.height);
  for (int row = 0; row < labels.height; ++row)
    for (int column = 0; column < labels.width; ++column) {
      const bool reading = smooth.at(row, column) > 0.0f;
      const double light = reading ? headlight(smooth, camera, row, column) : 0.0;
      const Rgb colour = label_colour(labels.at(row, column), reading);
      picture.at(row, column) = scaled_colour(colour, kAmbient + (1.0 - kAmbient) * light);
    }
  return picture;
}

Camera resized(const Camera& camera, double factor) {
  Camera result = camera;
  result.width = std::max(1, static_cast<int>(std::lround(camera.width * factor)));
  result.height = std::max(1, static_cast<int>(std::lround(camera.height * factor)));
  result.fx *= factor;
  result.fy *= factor;
  // Pixel centres are at integers: the image begins at -0.5.
  result.cx = (camera.cx + 0.5) * factor - 0.5;
  result.cy = (camera.cy + 0.5) * factor - 0.5;
  return result;
}

Camera zoomed_on(const Camera& camera, const Pose& T_world_camera, const std::vector<Scene>& shown, int width) {
  Eigen::AlignedBox2d seen;
  const Pose T_camera_world = T_world_camera.inverse();
  for (const Scene& scene : shown) {
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
      for (const Eigen::Vector3d& v : scene.objects[i]->mesh.vertices) {
        const Eigen::Vector3d p = T_camera_world * (scene.T_world_object[i] * v);
        if (p.z() > 0.01) seen.extend(project(camera, p));
      }
    }
  }
  if (seen.isEmpty()) return resized(camera, static_cast<double>(width) / camera.width);
  const double zoom = width / std::max({seen.sizes().x() * 1.5, seen.sizes().y() * 1.5 * 4.0 / 3.0, 80.0});
  Camera result = camera;
  result.width = width;
  result.height = width * 3 / 4;
  result.fx *= zoom;
  result.fy *= zoom;
  result.cx = (camera.cx - seen.center().x()) * zoom + result.width / 2.0;
  result.cy = (camera.cy - seen.center().y()) * zoom + result.height / 2.0;
  return result;
}

std::string to_png(const ColourImage& image) {
  if (image.pixels.empty()) throw std::invalid_argument("a picture without pixels");
  return encode_rgb_png(image.pixels.front().data(), image.width, image.height);
}

std::string to_jpeg(const ColourImage& image) {
  if (image.pixels.empty()) throw std::invalid_argument("a picture without pixels");
  cv::Mat bgr(image.height, image.width, CV_8UC3);
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) {
      const Rgb& rgb = image.at(v, u);
      bgr.at<cv::Vec3b>(v, u) = {rgb[2], rgb[1], rgb[0]};
    }
  }
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", bgr, bytes, {cv::IMWRITE_JPEG_QUALITY, 88});
  return {bytes.begin(), bytes.end()};
}

void write_picture(const ColourImage& image, const std::string& path) { write_file(path, to_png(image)); }

}  // namespace dofusion
