// Shaded pictures of scenes; see picture.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "perception/geom_scanner.h"
#include "perception/picture.h"
#include "perception/scanner.h"

namespace dofusion {
namespace {

using Linear = Eigen::Vector3f;  // light, proportional to power

constexpr int kSide = 2;                 // samples a pixel's side
constexpr float kSurfaceOffset = 1e-4f;  // metres; where shadow rays begin, above what floats resolve

float linear_of(std::uint8_t value) { return std::pow(static_cast<float>(value) / 255.0f, 2.2f); }
Linear linear_of(const Rgb& colour) { return {linear_of(colour[0]), linear_of(colour[1]), linear_of(colour[2])}; }
std::uint8_t byte_of(float value) {
  return static_cast<std::uint8_t>(std::lround(255.0f * std::pow(std::clamp(value, 0.0f, 1.0f), 1.0f / 2.2f)));
}

// Points of the unit disk that fill it evenly (a sunflower's pattern).
std::vector<Eigen::Vector2f> disk_points(int count) {
  constexpr float kGoldenAngle = 2.39996323f;
  std::vector<Eigen::Vector2f> points;
  for (int i = 0; i < count; ++i) {
    const float radius = std::sqrt((static_cast<float>(i) + 0.5f) / static_cast<float>(count));
    const float angle = kGoldenAngle * static_cast<float>(i);
    points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return points;
}

// Two unit vectors that make a frame with the unit vector n.
std::array<Eigen::Vector3f, 2> tangents(const Eigen::Vector3f& n) {
  const Eigen::Vector3f u = n.unitOrthogonal();
  return {u, n.cross(u)};
}

struct Lamp {
  Eigen::Vector3f direction;  // towards it, unit
  float radius = 0.08f;       // of its disk at distance 1
};

// To the left of the viewer and above.
Lamp lamp_for(const Pose& T_world_camera) {
  const Eigen::Vector3d right = T_world_camera.linear().col(0);
  const Eigen::Vector3d forward = T_world_camera.linear().col(2);
  Eigen::Vector3d back(-forward.x(), -forward.y(), 0.0);
  if (back.norm() > 1e-6) back.normalize();
  return {(-0.65 * right + 0.25 * back + 1.1 * Eigen::Vector3d::UnitZ()).normalized().cast<float>()};
}

struct Surface {
  Eigen::Vector3f point, normal;  // world; the point is a little above the surface
};

// How something looks.
struct Paint {
  Linear albedo = Linear::Zero();
  bool ground = false;  // fades to the backdrop, has no outline
  int outline = 1;      // samples
};

// What is seen at kSide times the picture's resolution, and how it looks.
struct Sight {
  DepthImage depth;
  NormalImage normals;
  IdImage things;               // -1 nothing
  std::vector<Paint> paints{};  // per thing
  float scale = 1.0f;           // how large the scene is; 1 is a table top
  // Where the ground begins to fade to the backdrop and where it has: metres from the sight's centre, times the scale.
  float fade_begin = 0.5f, fade_end = 1.6f;
  std::function<std::vector<std::uint8_t>(const std::vector<Scanner::Segment>&)> occluded{};
};

// Shades a sight row by row.
class Shader {
 public:
  Shader(Sight sight, const Camera& fine, const Pose& T_world_camera, const PictureOptions& options)
      : fine_(fine),
        T_world_camera_(T_world_camera),
        R_world_camera_(T_world_camera.linear().cast<float>()),
        lamp_(lamp_for(T_world_camera)),
        lamp_points_(disk_points(options.shadow_samples)),
        sky_points_(disk_points(options.ambient_samples)),
        sight_(std::move(sight)) {
    // The backdrop is as bright as the table in full light, so that the table fades without a seam.
    backdrop_ = lit(linear_of(kTableColour), Eigen::Vector3f::UnitZ(), 1.0f, 1.0f, -R_world_camera_.col(2));
    const Eigen::Vector3d eye = T_world_camera.translation(), forward = T_world_camera.linear().col(2);
    const double along = forward.z() < -0.1 ? -eye.z() / forward.z() : 1.0;
    centre_ = (eye + along * forward).cast<float>();
  }

  ColourImage picture(int width, int height) {
    ColourImage image(width, height);
    std::vector<Linear> sums(static_cast<std::size_t>(width));
    for (int row = 0; row < height; ++row) {
      std::fill(sums.begin(), sums.end(), Linear::Zero());
      for (int k = 0; k < kSide; ++k) add_fine_row(kSide * row + k, sums);
      for (int column = 0; column < width; ++column)
        for (int k = 0; k < 3; ++k)
          image.at(row, column)[static_cast<std::size_t>(k)] =
              byte_of(sums[static_cast<std::size_t>(column)][k] / (kSide * kSide));
    }
    return image;
  }

 private:
  void add_fine_row(int row, std::vector<Linear>& sums) {
    surfaces_.clear();
    for (int column = 0; column < fine_.width; ++column) surfaces_.push_back(surface_at(row, column));
    const std::vector<float> lamp = lamp_visibility(row);
    const std::vector<float> sky = sky_visibility(row);
    for (int column = 0; column < fine_.width; ++column) {
      const auto i = static_cast<std::size_t>(column);
      sums[i / kSide] += colour_at(row, column, lamp[i], sky[i]);
    }
  }

  Surface surface_at(int row, int column) const {
    const double depth = sight_.depth.at(row, column);
    const Eigen::Vector3f normal = R_world_camera_ * sight_.normals.at(row, column);
    const Eigen::Vector3d point = T_world_camera_ * unproject(fine_, column, row, depth);
    return {point.cast<float>() + kSurfaceOffset * normal, normal};
  }

  // The share of `points` (fractions of a light) that each surface of the row sees; direction(surface, point) says
  // where to look, zero for nowhere. The samples of a pixel take turns with the points.
  template <class Direction>
  std::vector<float> visibility(int row, const std::vector<Eigen::Vector2f>& points, const Direction& direction) {
    std::vector<float> seen(surfaces_.size(), 1.0f);
    if (points.empty()) return seen;
    constexpr std::size_t kTurns = kSide * kSide;
    segments_.clear();
    owners_.clear();
    for (std::size_t turn = 0; turn < points.size(); turn += kTurns)
      for (std::size_t i = 0; i < surfaces_.size(); ++i) {
        if (surfaces_[i].normal.isZero()) continue;
        const std::size_t own = (static_cast<std::size_t>(row) % kSide) * kSide + i % kSide;
        const Eigen::Vector3f towards = direction(surfaces_[i], points[std::min(turn + own, points.size() - 1)]);
        segments_.push_back({surfaces_[i].point, surfaces_[i].point + towards});
        owners_.push_back(i);
      }
    const auto rays = static_cast<float>((points.size() + kTurns - 1) / kTurns);
    const std::vector<std::uint8_t> hidden = sight_.occluded(segments_);
    for (std::size_t k = 0; k < hidden.size(); ++k) seen[owners_[k]] -= static_cast<float>(hidden[k]) / rays;
    return seen;
  }

  std::vector<float> lamp_visibility(int row) {
    const float lamp_distance = 3.0f * sight_.scale;  // metres
    const auto frame = tangents(lamp_.direction);
    return visibility(row, lamp_points_, [&](const Surface&, const Eigen::Vector2f& p) -> Eigen::Vector3f {
      return lamp_distance * (lamp_.direction + lamp_.radius * (p.x() * frame[0] + p.y() * frame[1]));
    });
  }

  std::vector<float> sky_visibility(int row) {
    const float reach = 0.15f * sight_.scale;  // metres; what lies farther does not darken
    return visibility(row, sky_points_, [&](const Surface& surface, const Eigen::Vector2f& p) -> Eigen::Vector3f {
      // Points of the disk lifted to the hemisphere: cosine-weighted.
      const auto frame = tangents(surface.normal);
      const float up = std::sqrt(std::max(0.0f, 1.0f - p.squaredNorm()));
      return reach * (p.x() * frame[0] + p.y() * frame[1] + up * surface.normal);
    });
  }

  Linear lit(const Linear& albedo, const Eigen::Vector3f& normal, float lamp, float sky,
             const Eigen::Vector3f& to_viewer) const {
    const float key = 0.75f * lamp * std::max(0.0f, normal.dot(lamp_.direction));
    const float fill = 0.18f * std::max(0.0f, normal.dot(to_viewer));
    const float ambient = (0.22f + 0.08f * normal.z()) * sky;
    return (key + fill + ambient) * albedo;
  }

  Linear colour_at(int row, int column, float lamp, float sky) const {
    const std::int32_t thing = sight_.things.at(row, column);
    if (thing < 0) return backdrop_;
    const Paint& paint = sight_.paints[static_cast<std::size_t>(thing)];
    const Surface& surface = surfaces_[static_cast<std::size_t>(column)];
    const Eigen::Vector3f to_viewer = (T_world_camera_.translation().cast<float>() - surface.point).normalized();
    const Linear colour = lit(paint.albedo, surface.normal, lamp, sky, to_viewer);
    if (paint.ground) {
      const float distance = (surface.point - centre_).head<2>().norm() / sight_.scale;
      const float share = (distance - sight_.fade_begin) / (sight_.fade_end - sight_.fade_begin);
      const float t = std::clamp(share, 0.0f, 1.0f);
      const float fade = t * t * (3.0f - 2.0f * t);  // without an edge where it begins
      return (1.0f - fade) * colour + fade * backdrop_;
    }
    return outlined(row, column, paint.outline) ? Linear(0.35f * colour) : colour;
  }

  // Within `reach` samples of another thing, seen from the nearer side.
  bool outlined(int row, int column, int reach) const {
    const std::int32_t thing = sight_.things.at(row, column);
    for (int r = row - reach; r <= row + reach; r += reach)
      for (int c = column - reach; c <= column + reach; c += reach) {
        if (sight_.things.contains(r, c) && sight_.things.at(r, c) != thing) return true;
      }
    return false;
  }

  Camera fine_;
  Pose T_world_camera_;
  Eigen::Matrix3f R_world_camera_;
  Lamp lamp_;
  std::vector<Eigen::Vector2f> lamp_points_, sky_points_;
  Sight sight_;
  Linear backdrop_ = Linear::Zero();
  Eigen::Vector3f centre_ = Eigen::Vector3f::Zero();
  std::vector<Surface> surfaces_;           // of the row being shaded
  std::vector<Scanner::Segment> segments_;  // scratch
  std::vector<std::size_t> owners_;         // scratch
};

// Things are labels less one: the table, then the objects.
Sight sight_of(const Scanner& scanner, const Camera& fine, const Pose& T_world_camera, const PictureOptions& options) {
  Scan scan = scanner.render(fine, T_world_camera);
  Sight sight{std::move(scan.depth), std::move(scan.normals), IdImage(fine.width, fine.height)};
  std::transform(scan.labels.pixels.begin(), scan.labels.pixels.end(), sight.things.pixels.begin(),
                 [](std::uint8_t label) { return label - kLabelTable; });
  sight.paints.push_back({linear_of(kTableColour), true, 1});
  for (int object = 0; object < 255 - kLabelFirstObject; ++object) {
    const bool highlighted = object == options.highlighted;
    sight.paints.push_back({linear_of(highlighted ? kQueryColour : object_colour(object)), false, highlighted ? 3 : 1});
  }
  sight.occluded = [&scanner](const std::vector<Scanner::Segment>& segments) { return scanner.occluded(segments); };
  return sight;
}

// Things are geoms.
Sight sight_of(const GeomScanner& scanner, const Camera& fine, const Pose& T_world_camera,
               const PictureOptions& options) {
  GeomScan scan = scanner.render(fine, T_world_camera);
  Sight sight{std::move(scan.depth), std::move(scan.normals), std::move(scan.geoms)};
  for (const Geom& geom : scanner.geoms()) {
    const bool highlighted = geom.body == options.highlighted;
    const Linear albedo = linear_of(highlighted ? kQueryColour : drawn_rgb(geom));
    sight.paints.push_back({albedo, geom.type == GeomType::kPlane, highlighted ? 3 : 1});
  }
  // As large as what is in the middle of the picture is far, in table tops 0.7 m away.
  const float middle = sight.depth.at(fine.height / 2, fine.width / 2);
  if (middle > 0.0f) sight.scale = middle / 0.7f;
  // A floor may be dark: it goes on to the horizon, where a bright rim would look like the edge of a disk.
  sight.fade_begin = 2.0f, sight.fade_end = 12.0f;
  sight.occluded = [&scanner](const std::vector<Scanner::Segment>& segments) { return scanner.occluded(segments); };
  return sight;
}

template <class AnyScanner>
ColourImage shaded(const AnyScanner& scanner, const Camera& camera, const Pose& T_world_camera,
                   const PictureOptions& options) {
  const Camera fine = resized(camera, kSide);
  return Shader(sight_of(scanner, fine, T_world_camera, options), fine, T_world_camera, options)
      .picture(camera.width, camera.height);
}

}  // namespace

ColourImage shaded_picture(const Scanner& scanner, const Camera& camera, const Pose& T_world_camera,
                           const PictureOptions& options) {
  return shaded(scanner, camera, T_world_camera, options);
}

ColourImage shaded_picture(const GeomScanner& scanner, const Camera& camera, const Pose& T_world_camera,
                           const PictureOptions& options) {
  return shaded(scanner, camera, T_world_camera, options);
}

ColourImage shaded_picture(const Scene& scene, const Camera& camera, const Pose& T_world_camera,
                           const PictureOptions& options) {
  Scanner scanner(scene.objects);
  scanner.set_poses(scene.T_world_object);
  return shaded_picture(scanner, camera, T_world_camera, options);
}

}  // namespace dofusion
