#include "perception/face_joining.h"

#include <algorithm>
#include <map>
#include <numeric>

namespace dofusion {
namespace {

constexpr int kTable = 0;
constexpr int kMinBorder = 5;             // pixels of continuous border that make two faces neighbours
constexpr double kMinContinuous = 0.5;    // share of a border
constexpr double kOtherPlane = 0.87;      // cosine; faces inclined more (30 degrees) are different sides
constexpr double kSliverThickness = 3.0;  // pixels; thinner faces carry no connection

// Parts of objects: sets of faces that only grow.
class Parts {
 public:
  explicit Parts(std::size_t faces) : parent_(faces) { std::iota(parent_.begin(), parent_.end(), 0); }
  int of(int face) const {
    while (parent_[face] != face) face = parent_[face];
    return face;
  }
  void join(int a, int b) { parent_[std::max(of(a), of(b))] = std::min(of(a), of(b)); }
  std::vector<int> faces_of(int part) const {
    std::vector<int> faces;
    for (std::size_t f = 0; f < parent_.size(); ++f) {
      if (of(static_cast<int>(f)) == part) faces.push_back(static_cast<int>(f));
    }
    return faces;
  }

 private:
  std::vector<int> parent_;
};

class Joiner {
 public:
  Joiner(const FaceMap& map, const DepthImage& depth, const Camera& camera, const SegmentationOptions& options)
      : map_(map),
        depth_(depth),
        camera_(camera),
        options_(options),
        edges_(find_face_edges(map, depth, camera, options.faces)),
        relation_(relate_faces(map, depth, camera, options.faces)),
        parts_(map.faces.size()),
        sliver_(find_slivers()) {}

  std::vector<int> join() {
    join_convex_neighbours();
    attach_slivers();
    join_fragments();
    if (options_.join_occluded) join_across_occluders();
    return numbered();
  }

 private:
  // A face whose border is long for its area lies along an edge or on flying pixels.
  std::vector<bool> find_slivers() const {
    std::vector<int> border(map_.faces.size(), 0);
    for (int v = 0; v < map_.index.height; ++v) {
      for (int u = 0; u < map_.index.width; ++u) {
        const int f = map_.index.at(v, u);
        if (f == kNoFace) continue;
        for (const auto& [dv, du] : {std::pair{0, 1}, {0, -1}, {1, 0}, {-1, 0}}) {
          if (!map_.index.contains(v + dv, u + du) || map_.index.at(v + dv, u + du) != f) {
            ++border[f];
            break;
          }
        }
      }
    }
    std::vector<bool> sliver(map_.faces.size(), false);
    for (std::size_t f = 1; f < sliver.size(); ++f) {
      sliver[f] = 2.0 * map_.faces[f].pixels < kSliverThickness * border[f];
    }
    return sliver;
  }

  bool is_joint(const FaceEdge& edge) const {
    if (edge.a == kTable || edge.b == kTable) return false;
    if (edge.angle_deg < options_.smooth_deg && is_warp(edge)) return true;
    if (edge.continuous < kMinBorder || edge.continuous < kMinContinuous * edge.length) return false;
    return edge.convexity > 0.0 || is_smooth(edge);
  }

  // Parallel planes whose readings differ no more at the border than the sensor bends a plane.
  bool is_warp(const FaceEdge& edge) const {
    constexpr double kStep = 1.0;   // sigmas, without any warp
    constexpr double kWarps = 3.0;  // what remains beyond the root mean square
    return edge.compared >= 2 * kMinBorder && std::abs(edge.reading_step) < kStep + kWarps * options_.warp;
  }
  bool is_smooth(const FaceEdge& edge) const {
    constexpr double kSharpest = 60.0;  // degrees between two planes that touch one bend
    if (edge.angle_deg < options_.smooth_deg) return true;
    return edge.angle_deg < kSharpest && is_bend(map_, edge.a, edge.b, depth_, camera_, options_.faces);
  }

  void join_convex_neighbours() {
    std::vector<FaceEdge> joints;
    for (const FaceEdge& edge : edges_) {
      if (is_joint(edge) && !sliver_[edge.a] && !sliver_[edge.b]) joints.push_back(edge);
    }
    std::stable_sort(joints.begin(), joints.end(),
                     [](const FaceEdge& a, const FaceEdge& b) { return a.continuous > b.continuous; });
    for (const FaceEdge& edge : joints) {
      const int a = parts_.of(edge.a), b = parts_.of(edge.b);
      if (a == b) continue;
      if (is_smooth(edge) || may_be_convex(parts_.faces_of(a), parts_.faces_of(b))) parts_.join(a, b);
    }
  }

  // No face of either part has much of the other part before it.
  bool may_be_convex(const std::vector<int>& a, const std::vector<int>& b) const {
    return lies_behind(a, b) && lies_behind(b, a);
  }
  bool lies_behind(const std::vector<int>& planes, const std::vector<int>& readings) const {
    double pixels = 0.0;
    for (const int g : readings) pixels += map_.faces[g].pixels;
    return std::all_of(planes.begin(), planes.end(), [&](int f) {
      double before = 0.0;
      for (const int g : readings) before += relation_[f][g].in_front * map_.faces[g].pixels;
      return before <= options_.max_in_front * pixels;
    });
  }

  void join_across_occluders() {
    for (std::size_t f = 1; f < map_.faces.size(); ++f) {
      for (std::size_t g = f + 1; g < map_.faces.size(); ++g) {
        const int a = parts_.of(static_cast<int>(f)), b = parts_.of(static_cast<int>(g));
        if (a != b && is_one_object_behind(parts_.faces_of(a), parts_.faces_of(b))) parts_.join(a, b);
      }
    }
  }

  // Two parts show the same planes and whatever lies between them is nearer to the camera. One common plane parallel
  // to the table says little, as boxes of one height are common, unless what hides the rest does not reach down to
  // the table and so must stand on it.
  bool is_one_object_behind(const std::vector<int>& a, const std::vector<int>& b) const {
    std::vector<std::pair<int, int>> alike;
    for (const int f : a) {
      for (const int g : b) {
        if (is_alike(f, g)) alike.emplace_back(f, g);
      }
    }
    if (alike.empty() || !may_be_convex(a, b)) return false;
    for (const auto& [f, g] : alike) {
      if (!is_hidden_between(f, g)) continue;
      if (is_same_plane(f, g) && (!is_level(f) || hides_from_above(f, g))) return true;
      for (const auto& [other, match] : alike) {
        if (map_.faces[f].normal().dot(map_.faces[other].normal()) < kOtherPlane) return true;
      }
    }
    return false;
  }

  bool is_level(int f) const { return std::abs(map_.faces[f].normal().dot(map_.faces[kTable].normal())) > 0.9; }

  // Planes that may be one, as far as a sensor's warp lets them.
  bool is_alike(int f, int g) const {
    constexpr double kAlike = 6.0, kAlikeOneWay = 3.0;  // standard deviations
    constexpr int kMinPixels = 80;
    if (map_.faces[f].pixels < kMinPixels || map_.faces[g].pixels < kMinPixels) return false;
    if (map_.faces[f].normal().dot(map_.faces[g].normal()) < std::cos(options_.smooth_deg * M_PI / 180.0)) return false;
    const double fg = relation_[f][g].rms, gf = relation_[g][f].rms;
    return std::max(fg, gf) < kAlike && std::min(fg, gf) < kAlikeOneWay;
  }

  bool is_same_plane(int f, int g) const {
    constexpr double kSame = 1.6;     // standard deviations
    constexpr double kCertain = 3.0;  // sigmas of a reading
    const FaceRelation& fg = relation_[f][g];
    const FaceRelation& gf = relation_[g][f];
    return std::min(fg.blur, gf.blur) < kCertain && fg.rms < kSame && gf.rms < kSame;
  }

  // On the straight lines from one face to the other every reading is nearer than the plane or on it.
  bool is_hidden_between(int f, int g) const {
    const int larger = map_.faces[f].pixels > map_.faces[g].pixels ? f : g;
    int open = 0, lines = 0;
    for (const auto& [from, to] : lines_between(f, g)) {
      ++lines;
      if (pixels_behind(from, to, larger) > 2) ++open;
    }
    return lines > 0 && open * 4 <= lines;
  }

  std::vector<std::pair<Eigen::Vector2i, Eigen::Vector2i>> lines_between(int f, int g) const {
    const std::vector<Eigen::Vector2i> from = some_pixels(f), to = some_pixels(g);
    std::vector<std::pair<Eigen::Vector2i, Eigen::Vector2i>> lines;
    for (std::size_t i = 0; i < std::min(from.size(), to.size()); ++i)
      lines.emplace_back(from[i], to[to.size() - 1 - i]);
    return lines;
  }

  template <class Visit>
  static void walk(const Eigen::Vector2i& from, const Eigen::Vector2i& to, Visit visit) {
    const int steps = std::max(1, (to - from).cwiseAbs().maxCoeff());
    for (int i = 0; i <= steps; ++i) {
      const Eigen::Vector2d p = from.cast<double>() + (to - from).cast<double>() * i / steps;
      visit(static_cast<int>(std::lround(p.y())), static_cast<int>(std::lround(p.x())));
    }
  }

  // Readings on a line, outside the face's own part, that lie behind the face's plane.
  int pixels_behind(const Eigen::Vector2i& from, const Eigen::Vector2i& to, int face) const {
    constexpr double kBehind = 5.0;  // sigmas
    const InversePlane& plane = map_.faces[face].plane;
    int behind = 0;
    walk(from, to, [&](int v, int u) {
      if (!is_valid_depth(depth_.at(v, u))) return;
      if (map_.index.at(v, u) != kNoFace && parts_.of(map_.index.at(v, u)) == parts_.of(face)) return;
      const double sigma = inverse_sigma(depth_.at(v, u), plane, camera_, options_.faces);
      if (1.0 / depth_.at(v, u) - plane.dot(pixel_ray(camera_, u, v)) < -kBehind * sigma) ++behind;
    });
    return behind;
  }

  // What is seen between the two faces ends above the table.
  bool hides_from_above(int f, int g) const {
    std::map<int, int> seen;
    for (const auto& [from, to] : lines_between(f, g)) {
      walk(from, to, [&](int v, int u) {
        const int other = map_.index.at(v, u);
        if (other == kNoFace || parts_.of(other) == parts_.of(f) || parts_.of(other) == parts_.of(g)) return;
        ++seen[other == kTable ? kTable : parts_.of(other)];
      });
    }
    if (seen.empty()) return false;
    const int occluder = std::max_element(seen.begin(), seen.end(), [](const auto& a, const auto& b) {
                           return a.second < b.second;
                         })->first;
    return occluder != kTable && is_lifted(occluder);
  }

  bool is_lifted(int part) const {
    constexpr double kLifted = 6.0;   // sigmas above the table
    constexpr double kLowest = 0.02;  // share of the part's readings that may be lower
    const InversePlane& table = map_.faces[kTable].plane;
    int all = 0, low = 0;
    for (std::size_t p = 0; p < depth_.pixels.size(); ++p) {
      const int f = map_.index.pixels[p];
      if (f == kNoFace || f == kTable || parts_.of(f) != part) continue;
      const int u = static_cast<int>(p) % depth_.width, v = static_cast<int>(p) / depth_.width;
      const double sigma = inverse_sigma(depth_.pixels[p], table, camera_, options_.faces);
      ++all;
      if (1.0 / depth_.pixels[p] - table.dot(pixel_ray(camera_, u, v)) < kLifted * sigma) ++low;
    }
    return low < kLowest * all;
  }

  std::vector<Eigen::Vector2i> some_pixels(int face) const {
    constexpr int kSome = 24;
    const int stride = std::max(1, map_.faces[face].pixels / kSome);
    std::vector<Eigen::Vector2i> pixels;
    int seen = 0;
    for (int v = 0; v < map_.index.height; ++v) {
      for (int u = 0; u < map_.index.width; ++u) {
        if (map_.index.at(v, u) == face && seen++ % stride == 0) pixels.emplace_back(u, v);
      }
    }
    return pixels;
  }

  // Slivers go to the part they have most continuous border with; without one they stay alone.
  void attach_slivers() {
    for (std::size_t s = 1; s < sliver_.size(); ++s) {
      if (!sliver_[s]) continue;
      int best = -1, longest = kMinBorder - 1;
      for (const FaceEdge& edge : edges_) {
        if (edge.a != static_cast<int>(s) && edge.b != static_cast<int>(s)) continue;
        const int other = edge.a == static_cast<int>(s) ? edge.b : edge.a;
        if (other == kTable || sliver_[other] || edge.continuous <= longest) continue;
        longest = edge.continuous;
        best = other;
      }
      if (best >= 0) parts_.join(static_cast<int>(s), best);
    }
  }

  // Parts too small for an object go to the part they continue without a step in depth, if most of their border does.
  void join_fragments() {
    constexpr double kMostly = 0.4;
    for (;;) {
      const std::vector<Fragment> fragments = find_fragments();
      bool joined = false;
      for (const Fragment& fragment : fragments) {
        if (parts_.of(fragment.part) != fragment.part || parts_.of(fragment.neighbour) == fragment.part) continue;
        if (fragment.common < kMostly * fragment.border) continue;
        parts_.join(fragment.part, fragment.neighbour);
        joined = true;
      }
      if (!joined) return;
    }
  }

  struct Fragment {
    int part = 0, neighbour = 0;  // the part with the longest continuous border
    int border = 0, common = 0;   // pixel pairs: all, and continuous ones with the neighbour
  };

  std::vector<Fragment> find_fragments() const {
    std::map<int, double> area;
    std::map<int, int> border;
    std::map<int, std::map<int, int>> common;
    for (int v = 0; v < depth_.height; ++v) {
      for (int u = 0; u < depth_.width; ++u) {
        const int f = map_.index.at(v, u);
        if (f == kNoFace || f == kTable) continue;
        const int part = parts_.of(f);
        const double z = depth_.at(v, u);
        area[part] += z * z / (camera_.fx * camera_.fy);
        for (const auto& [dv, du] : {std::pair{0, 1}, {0, -1}, {1, 0}, {-1, 0}}) {
          const int g = map_.index.contains(v + dv, u + du) ? map_.index.at(v + dv, u + du) : kNoFace;
          if (g != kNoFace && parts_.of(g) == part) continue;
          ++border[part];
          if (g == kNoFace || g == kTable || !is_continuous(z, depth_.at(v + dv, u + du), f, g)) continue;
          ++common[part][parts_.of(g)];
        }
      }
    }
    std::vector<Fragment> fragments;
    for (const auto& [part, size] : area) {
      if (size > options_.fragment_area || common[part].empty()) continue;
      const auto& best = *std::max_element(common[part].begin(), common[part].end(),
                                           [](const auto& a, const auto& b) { return a.second < b.second; });
      fragments.push_back({part, best.first, border[part], best.second});
    }
    return fragments;
  }

  bool is_continuous(double z, double other_z, int f, int g) const {
    constexpr double kPixels = 2.0;
    const double slope = std::max(map_.faces[f].plane.head<2>().norm(), map_.faces[g].plane.head<2>().norm());
    return std::abs(other_z - z) < 3.0 * options_.sigma(z) + kPixels * slope * z * z / camera_.fx;
  }

  std::vector<int> numbered() const {
    std::vector<int> number(map_.faces.size(), -1), result(map_.faces.size(), -1);
    int next = 0;
    for (std::size_t f = 1; f < result.size(); ++f) {
      int& n = number[parts_.of(static_cast<int>(f))];
      if (n < 0) n = next++;
      result[f] = n;
    }
    return result;
  }

  const FaceMap& map_;
  const DepthImage& depth_;
  const Camera& camera_;
  const SegmentationOptions& options_;
  std::vector<FaceEdge> edges_;
  std::vector<std::vector<FaceRelation>> relation_;
  Parts parts_;
  std::vector<bool> sliver_;
};

}  // namespace

std::vector<int> join_faces(const FaceMap& map, const DepthImage& depth, const Camera& camera,
                            const SegmentationOptions& options) {
  return Joiner(map, depth, camera, options).join();
}

}  // namespace dofusion
