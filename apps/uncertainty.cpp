#include "apps/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "perception/convex_body.h"
#include "perception/seen_surface.h"
#include "stability/metrics.h"
#include "stability/random.h"

namespace dofusion {
namespace {

constexpr int kAttempts = 4;
constexpr double kSeenShare = 0.3;   // of a triangle, above which it counts as seen
constexpr double kSameNormal = 0.999;  // cosine between a triangle's normal and its face's
constexpr double kDown = -0.9;       // z of a face's normal, below which the object lies on it: its support is known
constexpr double kSmallest = 0.2;    // of its volume, below which a drawn shape is none

// A face of a convex object of unknown shape, own frame.
struct Face {
  HalfSpace plane;
  bool seen = false, support = false;
};

struct UncertainObject {
  ObjectPtr object;
  Pose T_world_object = Pose::Identity();
  bool known = false;
  std::vector<Face> faces;                     // empty: the shape is taken as it is
  std::vector<Eigen::Vector3d> seen_points;    // own frame, corners of what was seen
  Eigen::Vector3d away = Eigen::Vector3d::UnitX();  // own frame, horizontal, from the cameras to the object
};

UncertainObject uncertain(const RecoveredObject& recovered, const std::vector<View>& views) {
  UncertainObject result{recovered.object, recovered.T_world_object, recovered.known, {}, {}, Eigen::Vector3d::UnitX()};
  if (recovered.known || !recovered.object->convex || views.empty()) return result;
  const TriangleMesh& mesh = recovered.object->mesh;
  const std::vector<float> shares = seen_shares(recovered, views);
  const Eigen::Matrix3d R_object_world = recovered.T_world_object.linear().transpose();
  for (const HalfSpace& plane : half_spaces(mesh)) {
    Face face{plane, false, (recovered.T_world_object.linear() * plane.normal).z() < kDown};
    result.faces.push_back(face);
  }
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (shares[i] < kSeenShare) continue;
    const Eigen::Vector3i& t = mesh.triangles[i];
    const Eigen::Vector3d a = mesh.vertices[t[0]], b = mesh.vertices[t[1]], c = mesh.vertices[t[2]];
    const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
    result.seen_points.insert(result.seen_points.end(), {a, b, c});
    for (Face& face : result.faces) face.seen = face.seen || face.plane.normal.dot(normal) > kSameNormal;
  }
  Eigen::Vector3d eye = Eigen::Vector3d::Zero();
  for (const View& view : views) eye += view.T_world_camera.translation() / static_cast<double>(views.size());
  Eigen::Vector3d away = recovered.T_world_object.translation() - eye;
  away.z() = 0.0;
  if (away.norm() > 1e-6) result.away = R_object_world * away.normalized();
  return result;
}

// A plane behind all that was seen that cuts off a part of what was not; nullopt if nothing is left to cut.
std::optional<HalfSpace> slanted_cut(const UncertainObject& object, Rng& rng) {
  if (object.seen_points.empty()) return std::nullopt;
  const Eigen::Vector3d up = object.T_world_object.linear().transpose() * Eigen::Vector3d::UnitZ();
  const double azimuth = uniform(rng, -1.0, 1.0), elevation = uniform(rng, 0.0, 1.0);
  const Eigen::Vector3d horizontal = so3_exp(azimuth * up) * object.away;
  HalfSpace plane;
  plane.normal = std::cos(elevation) * horizontal + std::sin(elevation) * up;
  const auto farthest = [&](const std::vector<Eigen::Vector3d>& points) {
    double most = -1e9;
    for (const Eigen::Vector3d& p : points) most = std::max(most, plane.normal.dot(p));
    return most;
  };
  const double seen = farthest(object.seen_points), whole = farthest(object.object->mesh.vertices);
  if (whole - seen < 1e-3) return std::nullopt;
  plane.offset = seen + uniform(rng, 0.0, 1.0) * (whole - seen);
  return plane;
}

// The convex body with its faces moved; the recovered one if too little is left of it.
ObjectAndOffset drawn_shape(const UncertainObject& object, const RecoveryUncertainty& sigma, Rng& rng) {
  const BoundingBox box = bounding_box(object.object->mesh);
  const Eigen::Vector3d margin = 0.5 * (box.max - box.min) + Eigen::Vector3d::Constant(0.01);
  const ObjectPtr around = make_box("around", box.max - box.min + 2.0 * margin);
  std::optional<TriangleMesh> mesh = translated(around->mesh, 0.5 * (box.max + box.min));
  for (const Face& face : object.faces) {
    HalfSpace plane = face.plane;
    const double moved = normal(rng, face.seen ? sigma.seen_face : sigma.hidden_face);
    if (!face.support) plane.offset += moved;
    if (mesh) mesh = cut(*mesh, plane);
  }
  if (uniform(rng) < sigma.slanted_share) {
    const std::optional<HalfSpace> plane = slanted_cut(object, rng);
    if (plane && mesh) mesh = cut(*mesh, *plane);
  }
  if (!mesh || volume(*mesh) < kSmallest * object.object->volume) return {object.object, Eigen::Vector3d::Zero()};
  try {
    return make_object(object.object->name, *mesh);
  } catch (const std::invalid_argument&) {  // a sliver among its faces
    return {object.object, Eigen::Vector3d::Zero()};
  }
}

// The same solid of another density: physics asks an object for volume and inertia alone.
ObjectPtr heavier(const ObjectPtr& object, double factor) {
  auto copy = std::make_shared<Object>(*object);
  copy->volume *= factor;
  copy->inertia *= factor;
  return copy;
}

Eigen::Vector3d horizontal(Rng& rng, double sigma) {
  const double x = normal(rng, sigma);
  return {x, normal(rng, sigma), 0.0};
}

}  // namespace

struct SceneSampler::Impl {
  Scene recovered;
  std::vector<UncertainObject> objects;
  PhysicsOptions physics;
  RecoveryUncertainty sigma;
  std::uint64_t seed = 0;

  Scene perturbed(Rng& rng) const {
    Scene scene;
    for (const UncertainObject& object : objects) {
      ObjectAndOffset shape{object.object, Eigen::Vector3d::Zero()};
      if (!object.faces.empty()) shape = drawn_shape(object, sigma, rng);
      Pose pose = object.T_world_object * Eigen::Translation3d(shape.origin);
      pose.pretranslate(horizontal(rng, object.known ? sigma.known_shift : sigma.unknown_shift));
      if (object.known) pose.linear() = so3_exp({0.0, 0.0, normal(rng, sigma.known_turn)}) * pose.linear();
      scene.objects.push_back(heavier(shape.object, std::exp(normal(rng, sigma.mass))));
      scene.T_world_object.push_back(pose);
    }
    return scene;
  }

  // At rest, if it stands about where it is.
  std::optional<Scene> standing(Scene scene, const PhysicsOptions& drawn_physics) const {
    if (scene.objects.empty()) return scene;
    const SettleResult settled = Simulator(scene.objects, drawn_physics).settle(scene.T_world_object);
    if (settled.status != SettleStatus::kSettled ||
        !is_stable(displacement(scene.objects, scene.T_world_object, settled.T_world_object)))
      return std::nullopt;
    scene.T_world_object = settled.T_world_object;
    return scene;
  }
};

SceneSampler::SceneSampler(const RecoveredScene& recovered, const PhysicsOptions& physics,
                           const RecoveryUncertainty& uncertainty, std::uint64_t seed)
    : impl_(std::make_unique<Impl>()) {
  impl_->recovered = recovered.scene;
  impl_->physics = physics;
  impl_->sigma = uncertainty;
  impl_->seed = seed;
  for (const RecoveredObject& object : recovered.objects) {
    impl_->objects.push_back(uncertain(object, recovered.views));
  }
}

SceneSampler::~SceneSampler() = default;

const RecoveryUncertainty& SceneSampler::uncertainty() const { return impl_->sigma; }

DrawnScene SceneSampler::draw(int index) const {
  const Impl& s = *impl_;
  Rng rng = make_rng(s.seed, static_cast<std::uint64_t>(index));
  DrawnScene drawn;
  drawn.physics = s.physics;
  drawn.physics.friction *= std::exp(normal(rng, s.sigma.friction));
  const double tilt_x = normal(rng, s.sigma.table_tilt), tilt_y = normal(rng, s.sigma.table_tilt);
  drawn.T_drawn_recovered =
      make_pose(so3_exp({tilt_x, tilt_y, 0.0}), Eigen::Vector3d(0.0, 0.0, normal(rng, s.sigma.table_height)));
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    if (const std::optional<Scene> scene = s.standing(s.perturbed(rng), drawn.physics)) {
      drawn.scene = *scene;
      return drawn;
    }
  }
  drawn.scene = s.recovered;
  return drawn;
}

}  // namespace dofusion
