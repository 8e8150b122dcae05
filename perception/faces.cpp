#include "perception/faces.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <numeric>

#include <Eigen/Dense>

namespace dofusion {
namespace {

// Sums of a weighted least-squares fit of 1/z = a·r, with the rays taken about a reference for the sake of digits.
struct PlaneSums {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double c = 0.0;
  int count = 0;

  void add(const Eigen::Vector3d& ray, double inverse, double sigma) {
    const double weight = 1.0 / (sigma * sigma);
    A += weight * ray * ray.transpose();
    b += weight * inverse * ray;
    c += weight * inverse * inverse;
    ++count;
  }
  void add(const PlaneSums& other) {
    A += other.A;
    b += other.b;
    c += other.c;
    count += other.count;
  }
  // Mean square of the deviations from the fitted plane, in sigmas.
  double variance(const InversePlane& fitted) const {
    return std::max(0.0, c - fitted.dot(b)) / std::max(1, count - 3);
  }
};

struct LocalFit {
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // towards the camera
  float rms = std::numeric_limits<float>::infinity();
  InversePlane plane = InversePlane::Zero();
};

class FaceFinder {
 public:
  FaceFinder(const DepthImage& depth, const Camera& camera, const Image<std::uint8_t>& mask,
             const std::vector<InversePlane>& fixed, const FaceOptions& options)
      : camera_(camera),
        options_(options),
        width_(depth.width),
        height_(depth.height),
        fixed_(static_cast<int>(fixed.size())) {
    collect_readings(depth, mask);
    map_.index = Image<int>(width_, height_, kNoFace);
    for (const InversePlane& plane : fixed) map_.faces.push_back({plane, 0, 0.0, Eigen::Matrix3d::Zero()});
  }

  FaceMap find() {
    claim_for_fixed();
    // Faces narrower than the surroundings of a reading show once their neighbours are taken out of these.
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
      fit_surroundings();
      for (const int seed : seeds_by_flatness()) grow(seed);
    }
    for (int i = 0; i < options_.iterations; ++i) {
      compete();
      refit();
      if (i == options_.iterations / 2) merge_alike();
    }
    drop_small();
    compete();
    refit();
    return std::move(map_);
  }

 private:
  int pixel(int v, int u) const { return v * width_ + u; }
  Eigen::Vector3d ray(int p) const { return pixel_ray(camera_, p % width_, p / width_); }

  double sigma_on(int p, const InversePlane& plane) const {
    const double slope = options_.lateral_px * plane.head<2>().norm() / camera_.fx;
    return std::sqrt(sigma_[p] * sigma_[p] + slope * slope);
  }
  double deviation(int p, const InversePlane& plane) const {  // in sigmas
    return (inverse_[p] - plane.dot(ray(p))) / sigma_on(p, plane);
  }

  void collect_readings(const DepthImage& depth, const Image<std::uint8_t>& mask) {
    inverse_.assign(depth.pixels.size(), 0.0F);
    sigma_.assign(depth.pixels.size(), 0.0F);
    for (std::size_t p = 0; p < depth.pixels.size(); ++p) {
      if (mask.pixels[p] == 0 || !is_valid_depth(depth.pixels[p])) continue;
      const double z = depth.pixels[p];
      inverse_[p] = static_cast<float>(1.0 / z);
      sigma_[p] = static_cast<float>(std::max(options_.sigma(z), 1e-5) / (z * z));
      readings_.push_back(static_cast<int>(p));
    }
  }

  std::optional<InversePlane> solve(const PlaneSums& sums) const {
    if (sums.count < 6) return std::nullopt;
    const InversePlane plane = sums.A.ldlt().solve(sums.b);
    if (!plane.allFinite() || plane.norm() < 1e-6) return std::nullopt;
    return plane;
  }

  // Readings on a fixed face whose surroundings lie like it neither start nor join another face, nor count among
  // the surroundings of others; the competition may still give them away.
  void claim_for_fixed() {
    constexpr float kAlike = 0.9F;  // cosine
    local_.resize(inverse_.size());
    std::vector<std::pair<int, int>> claims;
    for (const int p : readings_) {
      for (int f = 0; f < fixed_; ++f) {
        if (std::abs(deviation(p, map_.faces[f].plane)) > options_.grow) continue;
        if (fit_around(p).normal.dot(map_.faces[f].normal().cast<float>()) > kAlike) claims.emplace_back(p, f);
      }
    }
    for (const auto& [p, f] : claims) map_.index.pixels[p] = f;
  }

  // A plane through the surroundings of every reading that is left, without what lies across a depth step.
  void fit_surroundings() {
    for (const int p : readings_) {
      if (map_.index.pixels[p] == kNoFace) local_[p] = fit_around(p);
    }
  }

  LocalFit fit_around(int p) const {
    constexpr double kSteepest = 5.0;  // tangent of the steepest incidence that still counts as one surface
    const double z = 1.0 / inverse_[p];
    const double sigma_z = sigma_[p] * z * z;
    const int radius =
        std::clamp(static_cast<int>(std::lround(options_.window_sigmas * sigma_z * camera_.fx / z)), 3, 12);
    const int step = radius > 6 ? 2 : 1;
    const int v0 = p / width_, u0 = p % width_;
    PlaneSums sums;
    for (int v = std::max(0, v0 - radius); v <= std::min(height_ - 1, v0 + radius); v += step) {
      for (int u = std::max(0, u0 - radius); u <= std::min(width_ - 1, u0 + radius); u += step) {
        const int q = pixel(v, u);
        if (inverse_[q] <= 0.0F || map_.index.pixels[q] != kNoFace) continue;
        const double reach = kSteepest * z / camera_.fx * std::hypot(u - u0, v - v0) + 4.0 * sigma_z;
        if (std::abs(inverse_[q] - inverse_[p]) * z * z > reach) continue;
        // About the centre: x, y in the offset, so that the normal equations are well conditioned.
        sums.add({(u - u0) / camera_.fx, (v - v0) / camera_.fy, 1.0}, inverse_[q], sigma_[p]);
      }
    }
    LocalFit fit;
    const std::optional<InversePlane> local = solve(sums);
    if (!local) return fit;
    const Eigen::Vector3d r = ray(p);
    fit.plane = {local->x(), local->y(), local->z() - local->x() * r.x() - local->y() * r.y()};
    fit.rms = static_cast<float>(std::sqrt(sums.variance(*local)) * sigma_[p] / sigma_on(p, fit.plane));
    fit.normal = (-fit.plane.normalized()).cast<float>();
    return fit;
  }

  std::vector<int> seeds_by_flatness() const {
    constexpr float kFlat = 1.6F;  // sigmas
    std::vector<int> seeds;
    for (const int p : readings_) {
      if (map_.index.pixels[p] == kNoFace && local_[p].rms < kFlat && (p % width_) % 2 == 0 && (p / width_) % 2 == 0)
        seeds.push_back(p);
    }
    std::stable_sort(seeds.begin(), seeds.end(), [&](int a, int b) { return local_[a].rms < local_[b].rms; });
    return seeds;
  }

  void grow(int seed) {
    if (map_.index.pixels[seed] != kNoFace) return;
    const int face = static_cast<int>(map_.faces.size());
    const float cosine = static_cast<float>(std::cos(options_.normal_deg * M_PI / 180.0));
    InversePlane plane = local_[seed].plane;
    Eigen::Vector3f normal = local_[seed].normal;
    PlaneSums sums;
    std::vector<int> members{seed};
    map_.index.pixels[seed] = face;
    int next_refit = 40;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const int p = members[i];
      sums.add(ray(p), inverse_[p], sigma_[p]);
      if (sums.count == next_refit) {
        next_refit *= 2;
        if (const auto refined = solve(sums)) {
          plane = *refined;
          normal = (-plane.normalized()).cast<float>();
        }
      }
      const int v = p / width_, u = p % width_;
      for (const auto& [dv, du] : {std::pair{0, 1}, {0, -1}, {1, 0}, {-1, 0}}) {
        if (!map_.index.contains(v + dv, u + du)) continue;
        const int q = pixel(v + dv, u + du);
        if (inverse_[q] <= 0.0F || map_.index.pixels[q] != kNoFace) continue;
        if (std::abs(deviation(q, plane)) > options_.grow) continue;
        if (std::isfinite(local_[q].rms) && local_[q].rms < 2.0F && local_[q].normal.dot(normal) < cosine) continue;
        map_.index.pixels[q] = face;
        members.push_back(q);
      }
    }
    const std::optional<InversePlane> final_plane = solve(sums);
    if (sums.count >= options_.min_pixels && final_plane) {
      map_.faces.push_back({*final_plane, sums.count, 0.0, Eigen::Matrix3d::Zero()});
    } else {
      for (const int p : members) map_.index.pixels[p] = kNoFace;
    }
  }

  // Every reading goes to the face, among those of its neighbours, that fits its surroundings best.
  void compete() {
    const Image<int> before = map_.index;
    for (const int p : readings_) {
      const int v = p / width_, u = p % width_;
      std::array<int, 9> around;
      int count = 0;
      for (int dv = -1; dv <= 1; ++dv) {
        for (int du = -1; du <= 1; ++du) {
          if (before.contains(v + dv, u + du)) around[count++] = before.at(v + dv, u + du);
        }
      }
      const bool inside = std::all_of(around.begin(), around.begin() + count, [&](int f) { return f == around[0]; });
      if (inside && around[0] != kNoFace && std::abs(deviation(p, map_.faces[around[0]].plane)) < options_.grow)
        continue;
      map_.index.pixels[p] = best_face(p, around, count);
    }
  }

  int best_face(int p, const std::array<int, 9>& around, int count) const {
    int best = kNoFace;
    double best_cost = std::numeric_limits<double>::infinity();
    const auto consider = [&](int face) {
      const double own = deviation(p, map_.faces[face].plane);
      if (std::abs(own) > options_.keep) return;
      const double strangers = count - std::count(around.begin(), around.begin() + count, face);
      const double cost = surroundings_cost(p, map_.faces[face].plane) + options_.smoothness * strangers;
      if (cost < best_cost) best_cost = cost, best = face;
    };
    for (int i = 0; i < count; ++i) {
      if (around[i] == kNoFace || std::find(around.begin(), around.begin() + i, around[i]) != around.begin() + i)
        continue;
      consider(around[i]);
    }
    for (int f = 0; f < fixed_; ++f) consider(f);
    return best;
  }

  double surroundings_cost(int p, const InversePlane& plane) const {
    const int v0 = p / width_, u0 = p % width_;
    double sum = 0.0;
    int count = 0;
    for (int v = std::max(0, v0 - 1); v <= std::min(height_ - 1, v0 + 1); ++v) {
      for (int u = std::max(0, u0 - 1); u <= std::min(width_ - 1, u0 + 1); ++u) {
        if (inverse_[pixel(v, u)] <= 0.0F) continue;
        const double e = deviation(pixel(v, u), plane);
        sum += std::min(e * e, 16.0);
        ++count;
      }
    }
    return count > 0 ? sum / count : 16.0;
  }

  std::vector<PlaneSums> sum_faces(double most_sigmas) const {
    std::vector<PlaneSums> sums(map_.faces.size());
    for (const int p : readings_) {
      const int f = map_.index.pixels[p];
      if (f == kNoFace) continue;
      const InversePlane& plane = map_.faces[f].plane;
      if (std::abs(deviation(p, plane)) < most_sigmas) sums[f].add(ray(p), inverse_[p], sigma_on(p, plane));
    }
    return sums;
  }

  // Neighbouring faces that one plane explains become one: a face that grew from several seeds.
  void merge_alike() {
    constexpr double kAlike = 1.3;  // sigmas, of the common plane
    std::vector<PlaneSums> sums = sum_faces(options_.keep);
    std::vector<int> target(map_.faces.size());
    std::iota(target.begin(), target.end(), 0);
    for (const auto& [f0, g0] : neighbouring_faces()) {
      int f = f0, g = g0;
      while (target[f] != f) f = target[f];
      while (target[g] != g) g = target[g];
      if (f == g) continue;
      PlaneSums both = sums[f];
      both.add(sums[g]);
      const std::optional<InversePlane> plane = solve(both);
      if (!plane || both.variance(*plane) > kAlike * kAlike) continue;
      const int into = std::min(f, g), from = std::max(f, g);
      sums[into] = both;
      target[from] = into;
      map_.faces[into].plane = *plane;
    }
    for (int& f : map_.index.pixels) {
      while (f != kNoFace && target[f] != f) f = target[f];
    }
    refit();
  }

  // Pairs of not fixed faces with adjacent pixels, those with the longest common border first.
  std::vector<std::pair<int, int>> neighbouring_faces() const {
    std::map<std::pair<int, int>, int> borders;
    for (int v = 0; v + 1 < height_; ++v) {
      for (int u = 0; u + 1 < width_; ++u) {
        const int f = map_.index.at(v, u);
        for (const int g : {map_.index.at(v, u + 1), map_.index.at(v + 1, u)}) {
          if (f != g && f >= fixed_ && g >= fixed_) ++borders[std::minmax(f, g)];
        }
      }
    }
    std::vector<std::pair<int, std::pair<int, int>>> order;
    for (const auto& [pair, length] : borders) order.push_back({-length, pair});
    std::sort(order.begin(), order.end());
    std::vector<std::pair<int, int>> pairs;
    for (const auto& entry : order) pairs.push_back(entry.second);
    return pairs;
  }

  void refit() {
    const std::vector<PlaneSums> sums = sum_faces(2.5);
    for (std::size_t f = fixed_; f < sums.size(); ++f) {
      const std::optional<InversePlane> plane = solve(sums[f]);
      if (!plane) continue;
      map_.faces[f].plane = *plane;
      map_.faces[f].covariance = sums[f].A.ldlt().solve(Eigen::Matrix3d::Identity());
    }
    measure();
  }

  void measure() {
    for (Face& face : map_.faces) face.pixels = 0, face.rms = 0.0;
    for (const int p : readings_) {
      const int f = map_.index.pixels[p];
      if (f == kNoFace) continue;
      const double e = deviation(p, map_.faces[f].plane);
      map_.faces[f].pixels += 1;
      map_.faces[f].rms += e * e;
    }
    for (Face& face : map_.faces) face.rms = face.pixels > 0 ? std::sqrt(face.rms / face.pixels) : 0.0;
  }

  // Removes faces that lost most of their pixels and numbers the others anew.
  void drop_small() {
    std::vector<int> renamed(map_.faces.size(), kNoFace);
    std::vector<Face> kept;
    for (std::size_t f = 0; f < map_.faces.size(); ++f) {
      if (static_cast<int>(f) >= fixed_ && map_.faces[f].pixels < options_.min_pixels) continue;
      renamed[f] = static_cast<int>(kept.size());
      kept.push_back(map_.faces[f]);
    }
    for (int& f : map_.index.pixels) f = f == kNoFace ? kNoFace : renamed[f];
    map_.faces = std::move(kept);
  }

  const Camera& camera_;
  const FaceOptions& options_;
  int width_, height_, fixed_;
  std::vector<float> inverse_;  // (height * width) 1/z, 0 where there is no reading
  std::vector<float> sigma_;    // (height * width) of the inverse depth
  std::vector<int> readings_;   // pixels with a reading inside the mask
  std::vector<LocalFit> local_;
  FaceMap map_;
};

}  // namespace

double inverse_sigma(double z, const InversePlane& plane, const Camera& camera, const FaceOptions& options) {
  const double slope = options.lateral_px * plane.head<2>().norm() / camera.fx;
  return std::hypot(std::max(options.sigma(z), 1e-5) / (z * z), slope);
}

FaceMap find_faces(const DepthImage& depth, const Camera& camera, const Image<std::uint8_t>& mask,
                   const std::vector<InversePlane>& fixed, const FaceOptions& options) {
  check_image_size(depth.width, depth.height, camera);
  check_image_size(mask.width, mask.height, camera);
  return FaceFinder(depth, camera, mask, fixed, options).find();
}

}  // namespace dofusion
