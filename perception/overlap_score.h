// Scores of a segmentation against the true one.
#pragma once

#include "perception/image.h"

namespace dofusion {

struct OverlapScore {
  int found = 0;  // objects
  int true_objects = 0;
  double overlap_f = 0.0;   // 0 … 1
  double boundary_f = 0.0;  // 0 … 1
};

// Overlap and boundary F of Xie et al. ("Unseen Object Instance Segmentation for Robotic Environments", 2021): objects
// are matched one to one for the largest sum of F; P = sum |c_i and g_i| / sum |c_i|, R = sum |c_i and g_i| /
// sum |g_j|, F = 2PR/(P+R); the same over boundary pixels that count as common within `boundary_px`. Pixels that the
// truth leaves at 0 count for nobody. Without objects on both sides both scores are 1. Throws std::invalid_argument
// if the sizes differ.
OverlapScore score_segmentation(const LabelImage& found, const LabelImage& truth, int boundary_px = 2);

}  // namespace dofusion
