#include "perception/views.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>

#include <Eigen/Dense>

#include "perception/convex_body.h"

namespace dofusion {
namespace {

struct Plane {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // common frame, towards the cameras
  double height = 0.0;                            // up · p of its points, metres
  Eigen::Vector3d looked_at = Eigen::Vector3d::Zero();
  int agreeing = 0;  // views whose plane is about the same
};

// The plane of one view's table in the views' common frame; `table` maps its camera to the plane's own world.
Plane plane_of(const View& view, const Table& table) {
  const Pose T_common_table = view.T_world_camera * table.T_world_camera.inverse();
  Plane plane;
  plane.up = T_common_table.linear().col(2);
  plane.looked_at = T_common_table.translation();
  plane.height = plane.up.dot(plane.looked_at);
  return plane;
}

bool agree(const Plane& a, const Plane& b) {
  constexpr double kDistance = 0.03;
  const double kAngle = std::cos(5.0 * M_PI / 180.0);
  return a.up.dot(b.up) > kAngle && std::abs(a.up.dot(b.looked_at) - a.height) < kDistance &&
         std::abs(b.up.dot(a.looked_at) - b.height) < kDistance;
}

// Sums of a least squares fit z = a x + b y + c in a frame whose z = 0 is nearly the plane.
struct PlaneSums {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
};

void add_readings(const View& view, const Pose& T_frame_common, const TableOptions& options, PlaneSums& sums) {
  constexpr int kStride = 2;
  const Pose T_frame_camera = T_frame_common * view.T_world_camera;
  for (int v = 0; v < view.depth.height; v += kStride) {
    for (int u = 0; u < view.depth.width; u += kStride) {
      const float z = view.depth.at(v, u);
      if (!is_valid_depth(z) || z > options.max_depth) continue;
      const Eigen::Vector3d p = T_frame_camera * unproject(view.camera, u, v, z);
      // Noise moves a reading along its ray; across the table that is as much less as the ray is inclined.
      const Eigen::Vector3d ray = T_frame_camera.linear() * pixel_ray(view.camera, u, v);
      const double sigma = std::max(1e-5, options.sigma(z) * std::abs(ray.z()));
      if (std::abs(p.z()) > options.band * sigma) continue;
      const Eigen::Vector3d row(p.x(), p.y(), 1.0);
      sums.A += row * row.transpose() / (sigma * sigma);
      sums.b += row * p.z() / (sigma * sigma);
    }
  }
}

// A frame on the plane, its axes turned as little as possible.
Pose frame_on(const Pose& T_frame_common, const Eigen::Vector3d& abc) {
  const Eigen::Vector3d up = Eigen::Vector3d(-abc.x(), -abc.y(), 1.0).normalized();
  const Eigen::Matrix3d R = Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return make_pose(R, -R * Eigen::Vector3d(0.0, 0.0, abc.z())) * T_frame_common;
}

// What one view shows of one label.
struct Segment {
  std::uint8_t label = 0;
  std::vector<Eigen::Vector3d> points;  // world, some of them
  std::vector<HalfSpace> hull;          // empty if the points span no volume
};

std::map<std::uint8_t, Segment> segments_of(const View& view, const LabelFusionOptions& options) {
  std::map<std::uint8_t, Segment> segments;
  std::map<std::uint8_t, std::vector<Eigen::Vector3d>> all;
  for (int v = 0; v < view.depth.height; ++v) {
    for (int u = 0; u < view.depth.width; ++u) {
      const std::uint8_t label = view.labels.at(v, u);
      if (label < kLabelFirstObject || !is_valid_depth(view.depth.at(v, u))) continue;
      all[label].push_back(view.T_world_camera * unproject(view.camera, u, v, view.depth.at(v, u)));
    }
  }
  for (auto& [label, points] : all) {
    Segment& segment = segments[label];
    segment.label = label;
    const std::size_t step = points.size() / static_cast<std::size_t>(std::max(1, options.most_points)) + 1;
    for (std::size_t i = 0; i < points.size(); i += step) segment.points.push_back(points[i]);
    if (const auto hull = solid_hull(segment.points)) segment.hull = half_spaces(*hull);
  }
  return segments;
}

double share_inside(const std::vector<Eigen::Vector3d>& points, const std::vector<HalfSpace>& hull, double margin) {
  if (hull.empty() || points.empty()) return 0.0;
  const auto inside = std::count_if(points.begin(), points.end(),
                                    [&](const Eigen::Vector3d& p) { return plane_distance(hull, p) < margin; });
  return static_cast<double>(inside) / static_cast<double>(points.size());
}

// The parts, one a view, of one object.
using FusedObject = std::vector<Segment>;

double common_share(const Segment& segment, const FusedObject& object, double margin) {
  double share = 0.0;
  for (const Segment& other : object) {
    share = std::max(
        {share, share_inside(segment.points, other.hull, margin), share_inside(other.points, segment.hull, margin)});
  }
  return share;
}

double distance_to(const FusedObject& object, const Eigen::Vector3d& point) {
  double least = std::numeric_limits<double>::infinity();
  for (const Segment& part : object) {
    if (!part.hull.empty()) least = std::min(least, plane_distance(part.hull, point));
  }
  return least;
}

// Which objects a segment is seen of: those that hold at least half as much of it as the best one does.
std::vector<std::size_t> objects_of(const Segment& segment, const std::vector<FusedObject>& objects,
                                    const LabelFusionOptions& options) {
  std::vector<double> shares;
  for (const FusedObject& object : objects) shares.push_back(common_share(segment, object, options.margin));
  const double best = shares.empty() ? 0.0 : *std::max_element(shares.begin(), shares.end());
  std::vector<std::size_t> owners;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    if (shares[i] >= options.min_share && shares[i] >= 0.5 * best) owners.push_back(i);
  }
  return owners;
}

std::size_t nearest(const std::vector<std::size_t>& owners, const std::vector<FusedObject>& objects,
                    const Eigen::Vector3d& point) {
  return *std::min_element(owners.begin(), owners.end(), [&](std::size_t a, std::size_t b) {
    return distance_to(objects[a], point) < distance_to(objects[b], point);
  });
}

// Relabels one view; `objects` are those of the views before, to which its own are added.
void fuse_view(View& view, std::vector<FusedObject>& objects, const LabelFusionOptions& options) {
  constexpr std::size_t kMostObjects = 254;
  std::map<std::uint8_t, Segment> segments = segments_of(view, options);
  const std::vector<FusedObject> before = objects;
  std::map<std::uint8_t, std::vector<std::size_t>> owners_of;
  for (auto& [label, segment] : segments) {
    std::vector<std::size_t> owners = objects_of(segment, before, options);
    if (owners.empty() && objects.size() < kMostObjects) {
      owners = {objects.size()};
      objects.emplace_back();
    }
    // A segment of several objects is no part of any one of them.
    if (owners.size() == 1) objects[owners.front()].push_back(segment);
    owners_of[label] = owners;
  }
  for (int v = 0; v < view.labels.height; ++v) {
    for (int u = 0; u < view.labels.width; ++u) {
      std::uint8_t& label = view.labels.at(v, u);
      if (label < kLabelFirstObject) continue;
      const auto found = owners_of.find(label);
      if (found == owners_of.end() || found->second.empty()) {
        label = kLabelNothing;
        continue;
      }
      const std::vector<std::size_t>& owners = found->second;
      std::size_t owner = owners.front();
      if (owners.size() > 1) {
        if (!is_valid_depth(view.depth.at(v, u))) continue;
        owner = nearest(owners, before, view.T_world_camera * unproject(view.camera, u, v, view.depth.at(v, u)));
      }
      label = static_cast<std::uint8_t>(kLabelFirstObject + owner);
    }
  }
}

}  // namespace

Table table_of(const View& view) {
  Table table;
  table.T_world_camera = view.T_world_camera;
  return table;
}

std::optional<std::vector<View>> on_common_table(std::vector<View> views, const TableOptions& options) {
  if (views.empty()) throw std::invalid_argument("on_common_table: no view");
  std::vector<Plane> planes;
  std::vector<std::size_t> seen_by;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::optional<Table> table = find_table(views[i].depth, views[i].camera, options);
    if (!table) continue;
    planes.push_back(plane_of(views[i], *table));
    seen_by.push_back(i);
  }
  if (planes.empty()) return std::nullopt;
  for (Plane& plane : planes) {
    plane.agreeing = static_cast<int>(
        std::count_if(planes.begin(), planes.end(), [&](const Plane& other) { return agree(plane, other); }));
  }
  const Plane best = *std::max_element(planes.begin(), planes.end(),
                                       [](const Plane& a, const Plane& b) { return a.agreeing < b.agreeing; });
  Eigen::Matrix3d R = Eigen::Quaterniond::FromTwoVectors(best.up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  Pose T_frame_common = make_pose(R, -R * best.looked_at);
  for (int round = 0; round < 3; ++round) {
    PlaneSums sums;
    for (std::size_t i = 0; i < planes.size(); ++i) {
      if (agree(best, planes[i])) add_readings(views[seen_by[i]], T_frame_common, options, sums);
    }
    const Eigen::Vector3d abc = sums.A.ldlt().solve(sums.b);
    if (abc.allFinite()) T_frame_common = frame_on(T_frame_common, abc);
  }
  // The first camera's own conventions for the origin and the x axis.
  const Pose T_frame_first = T_frame_common * views.front().T_world_camera;
  Table in_frame;
  in_frame.T_world_camera = T_frame_first;
  if (T_frame_first.translation().z() <= 0.0) return std::nullopt;
  const Pose T_world_common =
      table_from_plane(table_plane(in_frame)).T_world_camera * views.front().T_world_camera.inverse();
  for (View& view : views) view.T_world_camera = T_world_common * view.T_world_camera;
  return views;
}

void segment_views(std::vector<View>& views, const SegmentationOptions& options) {
  for (View& view : views) view.labels = segment(view.depth, view.camera, table_of(view), options);
}

void fuse_labels(std::vector<View>& views, const LabelFusionOptions& options) {
  std::vector<int> counts;
  for (const View& view : views) counts.push_back(count_objects(view.labels));
  std::vector<int> sorted = counts;
  std::sort(sorted.begin(), sorted.end());
  const int median = sorted.empty() ? 0 : sorted[sorted.size() / 2];
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < views.size(); ++i) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::abs(counts[a] - median) < std::abs(counts[b] - median);
  });
  std::vector<FusedObject> objects;
  for (const std::size_t i : order) fuse_view(views[i], objects, options);
}

}  // namespace dofusion
