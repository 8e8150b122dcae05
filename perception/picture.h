// Pictures for people: shaded scenes, depth and segmentations in colour, as PNG.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "perception/camera.h"
#include "perception/geom_scanner.h"
#include "perception/image.h"
#include "perception/scanner.h"

namespace dofusion {

using Rgb = std::array<std::uint8_t, 3>;
using ColourImage = Image<Rgb>;

// A colour per object, distinct for the first ten; the highlighted query has one of its own.
Rgb object_colour(int index);
// A geom's own, as bytes.
Rgb drawn_rgb(const Geom& geom);
inline constexpr Rgb kQueryColour{240, 120, 20};
inline constexpr Rgb kTableColour{205, 205, 202};

struct PictureOptions {
  int highlighted = -1;      // object or body drawn in the query's colour and outlined; -1 none
  int shadow_samples = 16;   // rays a pixel towards the light, of 4 samples each; 0: no shadow
  int ambient_samples = 16;  // rays a pixel to the sky, as above; 0: no contact shading
};

// The scanner's scene with matt surfaces, one lamp with soft shadows beside the viewer and light from the sky, four
// samples a pixel. The table is light grey and fades out.
ColourImage shaded_picture(const Scanner& scanner, const Camera& camera, const Pose& T_world_camera,
                           const PictureOptions& options = {});
ColourImage shaded_picture(const Scene& scene, const Camera& camera, const Pose& T_world_camera,
                           const PictureOptions& options = {});

// The same of MuJoCo's geoms in their own colours; planes fade out. Everything is taken to be as large as what is in
// the middle of the picture is far.
ColourImage shaded_picture(const GeomScanner& scanner, const Camera& camera, const Pose& T_world_camera,
                           const PictureOptions& options = {});

// Near is warm, far is cold; the colours span the 1st to the 99th percentile of the readings. No reading is black.
ColourImage depth_picture(const DepthImage& depth);

// Labels as colours over shading worked out from the depth. Throws std::invalid_argument if the sizes differ.
ColourImage segmentation_picture(const LabelImage& labels, const DepthImage& depth, const Camera& camera);

// A picture with the same sight at another size, for instance half a sensor's for a report.
Camera resized(const Camera& camera, double factor);

// The same camera with its sight narrowed to what it sees of the scenes, with a border: `width` pixels wide, 4 to 3. If
// it sees nothing of them, its whole image in that width.
Camera zoomed_on(const Camera& camera, const Pose& T_world_camera, const std::vector<Scene>& shown, int width);

std::string to_png(const ColourImage& image);  // the file's bytes; throws std::invalid_argument without pixels
std::string to_jpeg(const ColourImage& image);  // likewise; a tenth of the size where a picture is shaded
void write_picture(const ColourImage& image, const std::string& path);  // throws InputError naming the file

}  // namespace dofusion
