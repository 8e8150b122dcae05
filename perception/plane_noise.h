// How much depth readings of a plane scatter, by distance: one measurement for real frames and for synthetic ones.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "perception/image.h"

namespace dofusion {

struct PlaneNoiseOptions {
  int window = 11;           // pixels; side of the square windows in which the readings' plane is fitted
  int margin = 2;            // pixels; a window stays this far from what is not the plane
  double half_width = 0.05;  // metres; a window counts for the distances that its mean depth is this near to
};

// Readings of windows near one distance.
struct NoiseBin {
  double distance = 0.0;   // metres
  double squares = 0.0;    // sum of each window's unbiased variance, times its pixels, square metres
  std::size_t pixels = 0;  // in whole windows
  double sigma() const;    // metres; 0 without pixels
};
std::vector<NoiseBin> noise_bins(const std::vector<double>& distances);

// Adds one image to the bins: windows that lie side by side, in which every pixel has the label kLabelTable (and so
// have those within the margin) and a reading. The scatter about each window's own least-squares plane, along the
// optical axis, so that neither the table's tilt nor what bends over more than a window counts. Throws
// std::invalid_argument if the images differ in size or the window is under 3 pixels.
void add_plane_noise(const DepthImage& depth, const LabelImage& labels, std::vector<NoiseBin>& bins,
                     const PlaneNoiseOptions& options = {});

// What the first Kinect's readings of a table scatter in 45 real frames (mOSD, tables seen at 46 to 56 degrees), in
// windows of 11 pixels: the reference that the Kinect model is made to match.
struct TableNoise {
  double distance, sigma;  // metres
};
inline constexpr std::array<TableNoise, 6> kKinectTableNoise{
    {{0.66, 0.81e-3}, {0.75, 1.01e-3}, {0.85, 1.25e-3}, {0.95, 1.55e-3}, {1.05, 1.85e-3}, {1.17, 2.29e-3}}};

}  // namespace dofusion
