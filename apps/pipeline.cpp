#include "apps/pipeline.h"

#include <algorithm>
#include <stdexcept>

#include "apps/stopwatch.h"
#include "perception/known_recovery.h"
#include "perception/plausibility.h"
#include "perception/seen_surface.h"
#include "perception/unknown_recovery.h"

namespace dofusion {
namespace {

// Labels 2 + i for objects[i]; pixels of labels that gave no object become 0.
LabelImage relabelled(const LabelImage& labels, const std::vector<RecoveredObject>& objects) {
  std::vector<std::uint8_t> new_label(256, kLabelNothing);
  new_label[kLabelTable] = kLabelTable;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    new_label[static_cast<std::size_t>(objects[i].label)] = static_cast<std::uint8_t>(kLabelFirstObject + i);
  }
  LabelImage result = labels;
  for (std::uint8_t& label : result.pixels) label = new_label[label];
  return result;
}

// Recovery may have moved pixels between objects: what an object has is what the label image shows.
void count_pixels(const LabelImage& labels, std::vector<RecoveredObject>& objects) {
  for (RecoveredObject& object : objects) object.pixels = 0;
  for (const std::uint8_t label : labels.pixels) {
    if (label >= kLabelFirstObject) ++objects.at(static_cast<std::size_t>(label - kLabelFirstObject)).pixels;
  }
}

// The table that the views share; brings them into its world.
std::optional<Table> find_common_table(std::vector<View>& views) {
  if (views.size() == 1) {
    const std::optional<Table> table = find_table(views.front().depth, views.front().camera);
    if (table) views.front().T_world_camera = table->T_world_camera;
    return table;
  }
  std::optional<std::vector<View>> on_table = on_common_table(views);
  if (!on_table) return std::nullopt;
  views = std::move(*on_table);
  return table_of(views.front());
}

}  // namespace

RecoveredScene recover_scene(const DepthImage& depth, const Camera& camera, const SceneRecoveryOptions& options) {
  return recover_scene(std::vector<View>{{depth, camera, Pose::Identity(), {}}}, options);
}

RecoveredScene recover_scene(const std::vector<View>& given, const SceneRecoveryOptions& options) {
  if (given.empty()) throw std::invalid_argument("recover_scene: no view");
  if (options.mask && given.size() > 1) throw std::invalid_argument("recover_scene: a mask goes with a single view");
  RecoveredScene result;
  Stopwatch watch;
  std::vector<View> views = given;
  result.table = find_common_table(views);
  if (!result.table) {
    result.timing_ms["segment"] = watch.lap_ms();
    return result;
  }
  if (options.mask) {
    views.front().labels = segment_with_mask(views.front().depth, views.front().camera, *result.table, *options.mask);
  } else {
    segment_views(views);
  }
  result.timing_ms["segment"] = watch.lap_ms();

  const View& first = views.front();
  if (options.library.empty()) {
    result.objects = recover_unknown(views);
    // Before the objects are moved away from their readings.
    for (const RecoveredObject& object : result.objects) result.seen.push_back(seen_shares(object, views));
  } else {
    KnownRecoveryOptions known;
    known.threads = options.threads;
    result.objects = recover_known(views, options.library, known);
  }
  // A label of one view may hold several objects if the other views part them.
  const bool by_shape = !options.library.empty() || views.size() > 1;
  result.labels = by_shape ? label_recovered(first.depth, first.camera, *result.table, first.labels, result.objects)
                           : relabelled(first.labels, result.objects);
  count_pixels(result.labels, result.objects);
  const PlausibleScene plausible = make_plausible(to_scene(result.objects), options.physics);
  result.scene = plausible.scene;
  result.settled = plausible.status;
  result.moved_pct = plausible.moved_pct;
  result.moved_deg = plausible.moved_deg;
  for (std::size_t i = 0; i < result.objects.size(); ++i) {
    result.objects[i].label = kLabelFirstObject + static_cast<int>(i);
    result.objects[i].pixels = static_cast<int>(
        std::count(result.labels.pixels.begin(), result.labels.pixels.end(), kLabelFirstObject + i));
    result.objects[i].object = result.scene.objects[i];
    result.objects[i].T_world_object = result.scene.T_world_object[i];
  }
  result.views = std::move(views);
  result.timing_ms["recover"] = watch.lap_ms();
  return result;
}

}  // namespace dofusion
