#include "perception/pose_hypotheses.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace dofusion {
namespace {

constexpr int kFewestFacePixels = 25;
constexpr std::size_t kMostFaces = 6;
constexpr std::size_t kMostFacePoints = 200;

struct Extent {
  double low = 0.0, high = 0.0;
  double centre() const { return 0.5 * (low + high); }
};

// All but the outermost `share` of the values on either side.
Extent robust_extent(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const auto skip = static_cast<std::size_t>(share * static_cast<double>(values.size()));
  return {values[skip], values[values.size() - 1 - skip]};
}

Extent extent_along(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& direction, double share) {
  std::vector<double> values;
  for (const Eigen::Vector3d& point : points) values.push_back(direction.dot(point));
  return robust_extent(std::move(values), share);
}

constexpr double kOutliers = 0.02;  // share of a face's readings beyond its true edge, either side

// The shifts that bring `shape` onto `seen`: centre to centre, low end to low end, high end to high end.
std::vector<double> shifts(const Extent& shape, const Extent& seen, double same_place) {
  std::vector<double> all = {seen.centre() - shape.centre()};
  if (std::abs(seen.low - shape.low - all[0]) > same_place) {
    all.push_back(seen.low - shape.low);
    all.push_back(seen.high - shape.high);
  }
  return all;
}

Eigen::Matrix3d rotation_to(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

Eigen::Matrix3d pair_frame(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Eigen::Matrix3d frame;
  frame.col(0) = (a + b).normalized();  // the error in the angle is shared by both faces
  frame.col(2) = a.cross(b).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

int turns_in(double period, double step) { return std::max(1, static_cast<int>(std::ceil(period / step - 1e-9))); }

struct PixelBox {
  Eigen::Vector2d min = Eigen::Vector2d::Constant(1e9);
  Eigen::Vector2d max = Eigen::Vector2d::Constant(-1e9);
};

PixelBox outline_box(const TriangleMesh& mesh, const Camera& camera, const Pose& T_camera_object) {
  PixelBox box;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    const Eigen::Vector3d p = T_camera_object * vertex;
    const Eigen::Vector2d pixel = project(camera, {p.x(), p.y(), std::max(p.z(), 0.01)});
    box.min = box.min.cwiseMin(pixel);
    box.max = box.max.cwiseMax(pixel);
  }
  return box;
}

// Moves the object in x and y so that the anchor (0 … 1 in the bounding boxes) of its outline meets the target's. Two
// Newton steps, each with the projection's slope at the object's centre.
Pose anchored(const TriangleMesh& mesh, const Camera& camera, const Pose& T_camera_world, const Target& target,
              const Eigen::Vector2d& anchor, Pose pose) {
  const Eigen::Vector2d goal = target.min_px + anchor.cwiseProduct(target.max_px - target.min_px);
  for (int i = 0; i < 2; ++i) {
    const PixelBox box = outline_box(mesh, camera, T_camera_world * pose);
    const Eigen::Vector2d now = box.min + anchor.cwiseProduct(box.max - box.min);
    const Eigen::Vector3d p = T_camera_world * pose.translation();
    if (p.z() < 0.01) return pose;
    Eigen::Matrix<double, 2, 3> slope;
    slope << camera.fx / p.z(), 0.0, -camera.fx * p.x() / (p.z() * p.z()),  //
        0.0, camera.fy / p.z(), -camera.fy * p.y() / (p.z() * p.z());
    const Eigen::Matrix2d per_xy = (slope * T_camera_world.linear()).leftCols<2>();
    if (std::abs(per_xy.determinant()) < 1e-6) return pose;
    pose.translation().head<2>() += per_xy.inverse() * (goal - now);
  }
  return pose;
}

}  // namespace

Target make_target(const std::vector<int>& pixels, const DepthImage& depth, const Camera& camera,
                   const Pose& T_world_camera, const FaceMap& face_map) {
  Target target;
  target.pixels = static_cast<int>(pixels.size());
  std::vector<double> columns, rows;
  std::map<int, std::vector<Eigen::Vector3d>> points;
  for (const int pixel : pixels) {
    const int v = pixel / depth.width, u = pixel % depth.width;
    const Eigen::Vector3d p_world = T_world_camera * unproject(camera, u, v, depth.pixels[pixel]);
    columns.push_back(u);
    rows.push_back(v);
    target.centroid += p_world / static_cast<double>(pixels.size());
    if (face_map.index.pixels[pixel] != kNoFace) points[face_map.index.pixels[pixel]].push_back(p_world);
  }
  const Extent across = robust_extent(std::move(columns), 0.003), down = robust_extent(std::move(rows), 0.003);
  target.min_px = {across.low, down.low};
  target.max_px = {across.high, down.high};

  std::vector<std::pair<int, int>> by_size;
  for (const auto& [face, on_face] : points) {
    if (static_cast<int>(on_face.size()) >= kFewestFacePixels) {
      by_size.emplace_back(-static_cast<int>(on_face.size()), face);
    }
  }
  std::sort(by_size.begin(), by_size.end());
  if (by_size.size() > kMostFaces) by_size.resize(kMostFaces);
  for (const auto& [size, face] : by_size) {
    const std::vector<Eigen::Vector3d>& on_face = points[face];
    SeenFace seen;
    seen.normal = T_world_camera.linear() * face_map.faces[face].normal();
    const std::size_t step = (on_face.size() + kMostFacePoints - 1) / kMostFacePoints;
    for (std::size_t i = 0; i < on_face.size(); i += step) seen.points.push_back(on_face[i]);
    for (const Eigen::Vector3d& point : seen.points) {
      seen.offset += seen.normal.dot(point) / static_cast<double>(seen.points.size());
    }
    target.faces.push_back(seen);
  }
  return target;
}

void add_resting_hypotheses(const std::vector<ObjectModel>& models, const Target& target, const Camera& camera,
                            const Pose& T_world_camera, const std::vector<double>& heights,
                            const HypothesisOptions& options, std::vector<PoseHypothesis>& hypotheses) {
  static const Eigen::Vector2d kAnchors[] = {{0.5, 0.5}, {0.0, 0.0}, {1.0, 0.0}, {0.0, 1.0}, {1.0, 1.0}};
  const Pose T_camera_world = T_world_camera.inverse();
  for (std::size_t m = 0; m < models.size(); ++m) {
    for (const DistinctRest& rest : models[m].resting) {
      const int turns = turns_in(rest.yaw_period, options.turn_step);
      for (int turn = 0; turn < turns; ++turn) {
        const Eigen::Vector3d yaw(0.0, 0.0, rest.yaw_period * turn / turns);
        for (const double height : heights) {
          const Eigen::Vector3d start(target.centroid.x(), target.centroid.y(), height + rest.pose.height);
          const Pose pose = make_pose(so3_exp(yaw) * rest.pose.R_world_object, start);
          std::vector<Eigen::Vector3d> places;
          for (const Eigen::Vector2d& anchor : kAnchors) {
            const Pose at = anchored(models[m].object->mesh, camera, T_camera_world, target, anchor, pose);
            const bool known = std::any_of(places.begin(), places.end(), [&](const Eigen::Vector3d& place) {
              return (place - at.translation()).norm() < options.same_place;
            });
            if (known) continue;
            places.push_back(at.translation());
            hypotheses.push_back({static_cast<int>(m), at, Freedom::kResting});
          }
        }
      }
    }
  }
}

void add_face_hypotheses(const std::vector<ObjectModel>& models, const Target& target, const HypothesisOptions& options,
                         std::vector<PoseHypothesis>& hypotheses) {
  for (const SeenFace& seen : target.faces) {
    for (std::size_t m = 0; m < models.size(); ++m) {
      for (const PlanarFace& face : models[m].distinct) {
        const Eigen::Matrix3d R0 = rotation_to(face.normal, seen.normal);
        const double period = 2.0 * M_PI / symmetry_order(models[m].symmetries, face.normal);
        const int turns = turns_in(period, options.turn_step);
        for (int turn = 0; turn < turns; ++turn) {
          const Eigen::Matrix3d R = so3_exp(seen.normal * (period * turn / turns)) * R0;
          const Eigen::Vector3d x = R * (face.corners[1] - face.corners[0]).normalized();
          const Eigen::Vector3d y = seen.normal.cross(x);
          const Eigen::Vector3d out = seen.normal * (seen.offset - face.normal.dot(face.centroid));
          const Eigen::Vector3d x_object = R.transpose() * x, y_object = R.transpose() * y;
          for (const double along : shifts(extent_along(face.corners, x_object, 0.0),
                                           extent_along(seen.points, x, kOutliers), options.same_place)) {
            for (const double across : shifts(extent_along(face.corners, y_object, 0.0),
                                              extent_along(seen.points, y, kOutliers), options.same_place)) {
              hypotheses.push_back({static_cast<int>(m), make_pose(R, out + x * along + y * across), Freedom::kFree});
            }
          }
        }
      }
    }
  }
}

void add_face_pair_hypotheses(const std::vector<ObjectModel>& models, const Target& target,
                              const HypothesisOptions& options, std::vector<PoseHypothesis>& hypotheses) {
  for (std::size_t i = 0; i < target.faces.size(); ++i) {
    for (std::size_t j = i + 1; j < target.faces.size(); ++j) {
      const SeenFace &first = target.faces[i], &second = target.faces[j];
      const double seen_angle = std::acos(std::clamp(first.normal.dot(second.normal), -1.0, 1.0));
      if (seen_angle < 0.4 || seen_angle > 2.75) continue;  // nearly parallel: no frame
      const Eigen::Matrix3d seen_frame = pair_frame(first.normal, second.normal);
      for (std::size_t m = 0; m < models.size(); ++m) {
        for (const PlanarFace& a : models[m].distinct) {
          for (const PlanarFace& b : models[m].faces) {
            const double angle = std::acos(std::clamp(a.normal.dot(b.normal), -1.0, 1.0));
            if (std::abs(angle - seen_angle) > options.angle_match) continue;
            const Eigen::Matrix3d R = seen_frame * pair_frame(a.normal, b.normal).transpose();
            Eigen::Matrix3d planes;
            planes << first.normal.transpose(), second.normal.transpose(), seen_frame.col(2).transpose();
            const Eigen::Vector3d edge = R.transpose() * seen_frame.col(2);
            for (const double along :
                 shifts(extent_along(a.corners, edge, 0.0), extent_along(first.points, seen_frame.col(2), kOutliers),
                        options.same_place)) {
              const Eigen::Vector3d offsets(first.offset - a.normal.dot(a.centroid),
                                            second.offset - b.normal.dot(b.centroid), along);
              hypotheses.push_back({static_cast<int>(m), make_pose(R, planes.inverse() * offsets), Freedom::kFree});
            }
          }
        }
      }
    }
  }
}

}  // namespace dofusion
