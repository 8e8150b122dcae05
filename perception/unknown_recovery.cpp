#include "perception/unknown_recovery.h"

#include <algorithm>
#include <limits>

#include "perception/shape_score.h"
#include "perception/stacking.h"
#include "stability/convex_parts.h"

namespace dofusion {
namespace {

// A shape may miss readings by what the sensor bends planes, too.
double widening(const UnknownRecoveryOptions& options) { return 1.0 + 0.6 * options.warp; }

// Views of all labels, those with the lowest feet first, so that what carries others comes before them.
std::vector<ObjectView> views_from_below(const DepthImage& depth, const Camera& camera, const Table& table,
                                         const LabelImage& labels, const UnknownRecoveryOptions& options) {
  std::vector<ObjectView> views;
  for (int label = kLabelFirstObject; label < kLabelFirstObject + count_objects(labels); ++label) {
    ObjectView view = view_object(depth, camera, table, labels, label, options.faces);
    if (static_cast<int>(view.points.size()) < options.min_pixels) continue;
    for (double& sigma : view.sigma) sigma *= widening(options);
    views.push_back(std::move(view));
  }
  std::stable_sort(views.begin(), views.end(),
                   [](const ObjectView& a, const ObjectView& b) { return a.lowest < b.lowest; });
  return views;
}

struct Cut {
  bool first = false;  // the first of the two bodies is cut, else the second
  HalfSpace keep;
  double lost = std::numeric_limits<double>::infinity();  // share of the readings that the cut takes off
};

double share_beyond(const ObjectView& view, const HalfSpace& keep) {
  int beyond = 0;
  for (std::size_t i = 0; i < view.points.size(); ++i) {
    if (keep.normal.dot(view.points[i]) - keep.offset > 2.0 * view.sigma[i]) ++beyond;
  }
  return static_cast<double>(beyond) / static_cast<double>(view.points.size());
}

// The face of one body that, as a cut through the other, takes the fewest readings off.
Cut find_cut(const Body& a, const Body& b) {
  Cut best;
  double best_volume = 0.0;
  for (const bool first : {false, true}) {
    const Body& knife = first ? b : a;
    const Body& cut_body = first ? a : b;
    for (const HalfSpace& face : half_spaces(knife.shape.mesh)) {
      const HalfSpace keep{-face.normal, -face.offset};
      const double lost = share_beyond(cut_body.view, keep);
      if (lost > best.lost + 0.02) continue;
      const std::optional<TriangleMesh> rest = cut(cut_body.shape.mesh, keep);
      if (!rest) continue;
      const double volume_left = volume(*rest) / volume(cut_body.shape.mesh);
      if (lost < best.lost - 0.02 || volume_left > best_volume) {
        best = {first, keep, lost};
        best_volume = volume_left;
      }
    }
  }
  return best;
}

// Cuts apart what overlaps. A pair that only a cut through much of what is seen could part stays as it is.
void part_neighbours(std::vector<Body>& bodies, const UnknownRecoveryOptions& options) {
  constexpr double kMostLost = 0.25;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    for (std::size_t j = i + 1; j < bodies.size(); ++j) {
      if (find_overlap(bodies[i].shape.mesh, bodies[j].shape.mesh).depth <= options.overlap) continue;
      const Cut parting = find_cut(bodies[i], bodies[j]);
      if (parting.lost > kMostLost) continue;
      Body& body = bodies[parting.first ? i : j];
      std::optional<TriangleMesh> rest = cut(body.shape.mesh, parting.keep);
      if (rest && is_high_enough(*rest, options.min_size)) body.shape.mesh = std::move(*rest);
    }
  }
}

RecoveredObject to_object(const Body& body, int index, const ShapeEvidence& evidence, double slack) {
  RecoveredObject result;
  result.name = "object_" + std::to_string(index);
  result.label = body.view.label;
  result.pixels = body.view.pixels;
  result.score = score_shape(body.shape.mesh, body.view, evidence, slack);
  TriangleMesh local = body.shape.mesh;
  const Eigen::Matrix3d& R = body.shape.R;
  for (Eigen::Vector3d& v : local.vertices) v = R.transpose() * v;
  const ObjectAndOffset made = make_object(result.name, local);
  result.object = with_convex_parts(made.object);
  result.T_world_object = make_pose(R, R * made.origin);
  return result;
}

}  // namespace

std::vector<RecoveredObject> recover_unknown(const DepthImage& depth, const Camera& camera, const Table& table,
                                             const LabelImage& labels, const UnknownRecoveryOptions& user_options) {
  check_image_size(depth.width, depth.height, camera);
  check_image_size(labels.width, labels.height, camera);
  UnknownRecoveryOptions options = user_options;
  if (options.calibrate) {
    options.sigma = calibrate_sigma(depth, camera, table, options.sigma);
    options.warp = measure_warp(depth, camera, table, options.sigma);
  }
  options.faces.sigma = options.sigma;
  const ShapeEvidence evidence{depth, labels, camera, table, options.sigma};

  std::vector<Body> bodies;
  for (ObjectView& view : views_from_below(depth, camera, table, labels, options)) {
    std::optional<FittedShape> shape = fit_on_support(view, bodies, evidence, options);
    if (shape) bodies.push_back({std::move(view), std::move(*shape)});
  }
  extend_hidden_supports(bodies, evidence, options);
  part_neighbours(bodies, options);
  std::sort(bodies.begin(), bodies.end(), [](const Body& a, const Body& b) { return a.view.label < b.view.label; });

  std::vector<RecoveredObject> objects;
  for (const Body& body : bodies) {
    objects.push_back(to_object(body, static_cast<int>(objects.size()), evidence, options.shape.slack));
  }
  return objects;
}

Scene to_scene(const std::vector<RecoveredObject>& objects) {
  Scene scene;
  for (const RecoveredObject& object : objects) {
    scene.objects.push_back(object.object);
    scene.T_world_object.push_back(object.T_world_object);
  }
  return scene;
}

}  // namespace dofusion
