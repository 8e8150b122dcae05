#include "perception/unknown_recovery.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "perception/shape_score.h"
#include "perception/stacking.h"
#include "stability/convex_parts.h"

namespace dofusion {
namespace {

// How exactly one view's sensor measures.
struct Exactness {
  DepthSigma sigma;
  double warp = 0.0;  // sigmas by which it bends planes
};

Exactness exactness_of(const View& view, const UnknownRecoveryOptions& options) {
  if (!options.calibrate) return {options.sigma, options.warp};
  const Table table = table_of(view);
  const DepthSigma sigma = calibrate_sigma(view.depth, view.camera, table, options.sigma);
  return {sigma, measure_warp(view.depth, view.camera, table, sigma)};
}

// What one view shows of an object. Its shape may miss readings by what the sensor bends planes, too.
ObjectView view_of_label(const View& view, int label, const Exactness& exact, const UnknownRecoveryOptions& options) {
  FaceOptions faces = options.faces;
  faces.sigma = exact.sigma;
  ObjectView seen = view_object(view.depth, view.camera, table_of(view), view.labels, label, faces);
  for (double& sigma : seen.sigma) sigma *= 1.0 + 0.6 * exact.warp;
  return seen;
}

// All labels, those with the lowest feet first, so that what carries others comes before them.
std::vector<ObjectView> objects_from_below(const std::vector<View>& views, const std::vector<Exactness>& exact,
                                           const UnknownRecoveryOptions& options) {
  int labels = 0;
  for (const View& view : views) labels = std::max(labels, count_objects(view.labels));
  std::vector<ObjectView> objects;
  for (int label = kLabelFirstObject; label < kLabelFirstObject + labels; ++label) {
    std::vector<ObjectView> seen;
    for (std::size_t i = 0; i < views.size(); ++i) seen.push_back(view_of_label(views[i], label, exact[i], options));
    ObjectView object = seen.size() == 1 ? std::move(seen.front()) : joined(seen);
    if (static_cast<int>(object.points.size()) >= options.min_pixels) objects.push_back(std::move(object));
  }
  std::stable_sort(objects.begin(), objects.end(),
                   [](const ObjectView& a, const ObjectView& b) { return a.lowest < b.lowest; });
  return objects;
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

// From the fused label to the one that most of its pixels had in the first view.
void label_in_first_view(const View& first, const LabelImage& fused, RecoveredObject& object) {
  std::vector<int> votes(256, 0);
  object.pixels = 0;
  for (std::size_t p = 0; p < fused.pixels.size(); ++p) {
    if (fused.pixels[p] != object.label) continue;
    ++object.pixels;
    ++votes[first.labels.pixels[p]];
  }
  object.label = object.pixels > 0 ? static_cast<int>(std::max_element(votes.begin(), votes.end()) - votes.begin()) : 0;
}

}  // namespace

std::vector<RecoveredObject> recover_unknown(const DepthImage& depth, const Camera& camera, const Table& table,
                                             const LabelImage& labels, const UnknownRecoveryOptions& options) {
  return recover_unknown({View{depth, camera, table.T_world_camera, labels}}, options);
}

std::vector<RecoveredObject> recover_unknown(const std::vector<View>& user_views,
                                             const UnknownRecoveryOptions& user_options) {
  if (user_views.empty()) throw std::invalid_argument("recover_unknown: no view");
  for (const View& view : user_views) {
    check_image_size(view.depth.width, view.depth.height, view.camera);
    check_image_size(view.labels.width, view.labels.height, view.camera);
  }
  std::vector<View> views = user_views;
  if (views.size() > 1) fuse_labels(views);
  std::vector<Exactness> exact;
  ShapeEvidence evidence;
  for (const View& view : views) {
    exact.push_back(exactness_of(view, user_options));
    evidence.push_back({view.depth, view.labels, view.camera, view.T_world_camera, exact.back().sigma});
  }
  UnknownRecoveryOptions options = user_options;
  options.sigma = exact.front().sigma;

  std::vector<Body> bodies;
  for (ObjectView& view : objects_from_below(views, exact, options)) {
    std::optional<FittedShape> shape = fit_on_support(view, bodies, evidence, options);
    if (shape) bodies.push_back({std::move(view), std::move(*shape)});
  }
  extend_hidden_supports(bodies, evidence, options);
  part_neighbours(bodies, options);
  std::sort(bodies.begin(), bodies.end(), [](const Body& a, const Body& b) { return a.view.label < b.view.label; });

  std::vector<RecoveredObject> objects;
  for (const Body& body : bodies) {
    objects.push_back(to_object(body, static_cast<int>(objects.size()), evidence, options.shape.slack));
    if (views.size() > 1) label_in_first_view(user_views.front(), views.front().labels, objects.back());
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
