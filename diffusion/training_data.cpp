#include "diffusion/training_data.h"

#include <algorithm>
#include <cmath>

#include "diffusion/schedule.h"
#include "diffusion/se3_noise.h"
#include "stability/files.h"
#include "stability/shape_symmetry.h"

namespace dofusion {
namespace {

// Every vertex has its mirror image in y among the vertices.
bool mirrors_in_y(const TriangleMesh& mesh) {
  const double tolerance = 1e-6 * diameter(mesh);
  return std::all_of(mesh.vertices.begin(), mesh.vertices.end(), [&](const Eigen::Vector3d& v) {
    const Eigen::Vector3d image(v.x(), -v.y(), v.z());
    return std::any_of(mesh.vertices.begin(), mesh.vertices.end(),
                       [&](const Eigen::Vector3d& w) { return (w - image).norm() < tolerance; });
  });
}

// The mirror image in the world's x of a shape that is its own mirror image in y, as a rigid pose.
Pose mirrored(const Pose& pose) {
  Pose result = Pose::Identity();
  result.linear() = Eigen::Vector3d(-1, 1, 1).asDiagonal() * pose.linear() * Eigen::Vector3d(1, -1, 1).asDiagonal();
  result.translation() = Eigen::Vector3d(-1, 1, 1).asDiagonal() * pose.translation();
  return result;
}

}  // namespace

TrainingSet::TrainingSet(std::vector<SceneDataset> datasets, const ModelConfig& config) : config_(config) {
  for (SceneDataset& dataset : datasets) {
    const int first = static_cast<int>(shapes_.size());
    for (const ObjectPtr& object : dataset.shapes) {
      constexpr double kExact = 1e-3;  // of the diameter: what is only nearly alike is not the same
      ShapeSymmetry symmetry;
      if (config_.equivalent) symmetry = symmetry_of(*object, kExact);
      shapes_.push_back({object, object->convex && mirrors_in_y(object->mesh), std::move(symmetry)});
    }
    for (SceneRecord& record : dataset.scenes) {
      for (SceneObject& object : record.objects) {
        if (!object.T_world_object.matrix().allFinite() || !object.scale.allFinite())
          throw InputError("scene " + std::to_string(record.index) + " of the dataset has a pose that is not finite");
        object.shape += first;
      }
      if (!record.objects.empty()) scenes_.push_back({std::move(record.objects), record.task == Task::kStack});
    }
  }
  if (scenes_.empty()) throw InputError("there is no scene to train on");
  const auto objects_of = [](const TrainingScene& scene) { return static_cast<int>(scene.objects.size()); };
  std::stable_sort(scenes_.begin(), scenes_.end(), [&](const TrainingScene& a, const TrainingScene& b) {
    return objects_of(a) < objects_of(b);
  });
  for (int begin = 0, end = 0; begin < static_cast<int>(scenes_.size()); begin = end) {
    const int objects = objects_of(scenes_[static_cast<std::size_t>(begin)]);
    while (end < static_cast<int>(scenes_.size()) && objects_of(scenes_[static_cast<std::size_t>(end)]) == objects) ++end;
    by_count_.emplace_back(begin, end);
    weight_ += objects;
  }
}

const TrainingSet::TrainingScene& TrainingSet::draw_scene(Rng& rng) const {
  int left = uniform_int(rng, 0, weight_ - 1);
  auto chosen = by_count_.begin();
  const auto objects = [&] { return static_cast<int>(scenes_[static_cast<std::size_t>(chosen->first)].objects.size()); };
  while (left >= objects()) {
    left -= objects();
    ++chosen;
  }
  return scenes_[static_cast<std::size_t>(uniform_int(rng, chosen->first, chosen->second - 1))];
}

CloudShapePtr TrainingSet::cloud_shape(const Shape& shape, const Eigen::Vector3d& scale) const {
  const Object& object = *shape.object;
  if (!object.convex) return std::make_shared<CloudShape>(*scaled(object, scale));
  std::optional<Eigen::Vector3d> edges;
  if (object.box_edges) edges = object.box_edges->cwiseProduct(scale);
  return std::make_shared<CloudShape>(scaled(object.mesh, scale), edges);
}

// Of the poses in which the query looks as in the clean one, the nearest in angle to the noisy one: the mean over equal
// poses, which the network would learn instead, means nothing.
Pose TrainingSet::nearest_equivalent(const Shape& shape, const Eigen::Vector3d& scale, const Pose& clean,
                                     const Pose& noisy) const {
  // A stretched shape keeps the rotations that stretching leaves rotations.
  const auto survives = [&](const Eigen::Matrix3d& R) {
    return (scale.asDiagonal() * R * scale.cwiseInverse().asDiagonal() - R).norm() < 1e-6;
  };
  const ShapeSymmetry& symmetry = shape.symmetry;
  Pose nearest = clean;
  if (symmetry.ball && scale.isConstant(scale.x(), 1e-6)) {
    nearest.linear() = noisy.linear();
    return nearest;
  }
  std::optional<Eigen::Vector3d> axis = symmetry.axis;
  if (axis && !survives(Eigen::AngleAxisd(1.0, *axis).toRotationMatrix())) axis.reset();
  const auto likeness = [&](const Eigen::Matrix3d& R) { return (noisy.linear().transpose() * R).trace(); };
  double best = -1e9;
  const auto consider = [&](Eigen::Matrix3d R) {
    if (axis) {  // turned about the axis to where it is most alike: the twist of the rest of the way
      const Eigen::Quaterniond rest(R.transpose() * noisy.linear());
      R *= Eigen::AngleAxisd(2.0 * std::atan2(rest.vec().dot(*axis), rest.w()), *axis).toRotationMatrix();
    }
    if (likeness(R) <= best) return;
    best = likeness(R);
    nearest.linear() = R;
  };
  consider(clean.linear());
  for (const Eigen::Matrix3d& R : symmetry.rotations)
    if (survives(R)) consider(clean.linear() * R);
  return nearest;
}

// The object as it might be perceived.
void TrainingSet::perceive(const SceneObject& object, double length, Rng& rng, CloudShapePtr& shape,
                           Pose& pose) const {
  const double s = config_.perception_noise;
  const auto normal3 = [&] { return Eigen::Vector3d{normal(rng), normal(rng), normal(rng)}; };  // braces: in this order
  const Eigen::Vector3d stretch = (s * normal3()).array().exp();
  shape = cloud_shape(shapes_[static_cast<std::size_t>(object.shape)], object.scale.cwiseProduct(stretch));
  const Eigen::Vector3d centre = pose.translation();
  pose.linear() = so3_exp(s * normal3()) * pose.linear();
  pose.translation() = centre + s * length * normal3();
}

void TrainingSet::append(std::uint64_t seed, std::uint64_t example, NetworkInput& batch,
                         std::vector<float>& target_values) const {
  Rng rng = make_rng(seed, example);
  const auto& [objects, stack] = draw_scene(rng);
  const int last = static_cast<int>(objects.size()) - 1;
  const int query = stack ? last : uniform_int(rng, 0, last);
  const Eigen::AngleAxisd yaw(uniform(rng, 0.0, 2.0 * M_PI), Eigen::Vector3d::UnitZ());
  const bool mirror = uniform(rng) < 0.5 && std::all_of(objects.begin(), objects.end(),
                                                        [&](const SceneObject& o) { return shapes_[o.shape].mirrors; });

  std::vector<CloudShapePtr> shapes;
  std::vector<Pose> poses;
  std::vector<double> volumes;
  for (const SceneObject& object : objects) {
    const Shape& shape = shapes_[object.shape];
    shapes.push_back(cloud_shape(shape, object.scale));
    volumes.push_back(shape.object->volume * object.scale.prod());
    const Pose pose = mirror ? mirrored(object.T_world_object) : object.T_world_object;
    poses.push_back(Pose(yaw * pose));
  }
  const double length = normalised_length(volumes);
  const double sigma = draw_sigma(config_, rng);
  const Vector6 noise = noise6(rng, sigma);
  const Pose clean = poses[query];
  Vector6 wanted;
  if (config_.preset == Preset::kPaper) {
    poses[query] = add_body_noise(clean, noise, length);
    wanted = noise / sigma;
  } else {
    poses[query] = add_world_noise(clean, noise, length);
    const SceneObject& object = objects[static_cast<std::size_t>(query)];
    const Pose target =
        config_.equivalent ? nearest_equivalent(shapes_[object.shape], object.scale, clean, poses[query]) : clean;
    wanted = world_residual(poses[query], target, sigma, length);
  }
  for (int i = 0; config_.perception_noise > 0.0 && i <= last; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (i != query) perceive(objects[k], length, rng, shapes[k], poses[k]);
  }
  append_input(config_, shapes, poses, query, length, sigma, Eigen::Vector2d::Zero(), config_.points, rng, batch);
  for (int i = 0; i < 6; ++i) target_values.push_back(static_cast<float>(wanted[i]));
}

void append_input(const ModelConfig& config, const std::vector<CloudShapePtr>& shapes,
                  const std::vector<Pose>& T_world_object, int query, double length, double sigma,
                  const Eigen::Vector2d& origin, int points, Rng& rng, NetworkInput& batch) {
  const bool paper = config.preset == Preset::kPaper;
  const Pose& pose = T_world_object[query];
  CloudOptions options;
  options.points = points;
  options.query_points = static_cast<int>(std::lround(config.query_share * points));
  options.sharp_share = config.sharp_share;
  options.length = length;
  options.distance_limit = config.distance_limit;
  options.origin.head<2>() = paper ? origin : pose.translation().head<2>();
  const std::size_t start = batch.cloud.size();
  batch.points = points;
  batch.cloud.resize(start + static_cast<std::size_t>(points) * kCloudChannels);
  make_augmented_cloud(shapes, T_world_object, query, options, rng, batch.cloud.data() + start);
  if (paper) {
    const Eigen::Vector3d position = (pose.translation() - options.origin) / length, turn = so3_log(pose.linear());
    for (int i = 0; i < 3; ++i) batch.pose.push_back(static_cast<float>(position[i]));
    for (int i = 0; i < 3; ++i) batch.pose.push_back(static_cast<float>(turn[i]));
  } else {
    for (int i = 0; i < 9; ++i) batch.pose.push_back(static_cast<float>(pose.linear()(i / 3, i % 3)));
    batch.pose.push_back(static_cast<float>(pose.translation().z() / length));
  }
  batch.sigma.push_back(static_cast<float>(sigma));
  ++batch.batch;
}

}  // namespace dofusion
