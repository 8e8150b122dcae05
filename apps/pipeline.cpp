#include "apps/pipeline.h"

#include <algorithm>

#include "apps/stopwatch.h"
#include "perception/known_recovery.h"
#include "perception/plausibility.h"
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

}  // namespace

RecoveredScene recover_scene(const DepthImage& depth, const Camera& camera, const SceneRecoveryOptions& options) {
  RecoveredScene result;
  Stopwatch watch;
  result.table = find_table(depth, camera);
  if (!result.table) {
    result.timing_ms["segment"] = watch.lap_ms();
    return result;
  }
  LabelImage labels = options.mask ? segment_with_mask(depth, camera, *result.table, *options.mask)
                                   : segment(depth, camera, *result.table);
  result.timing_ms["segment"] = watch.lap_ms();

  if (options.library.empty()) {
    result.objects = recover_unknown(depth, camera, *result.table, labels);
    result.labels = relabelled(labels, result.objects);
  } else {
    KnownRecoveryOptions known;
    known.threads = options.threads;
    result.objects = recover_known(depth, camera, *result.table, labels, options.library, known);
    result.labels = label_recovered(depth, camera, *result.table, labels, result.objects);
  }
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
  result.timing_ms["recover"] = watch.lap_ms();
  return result;
}

}  // namespace dofusion
