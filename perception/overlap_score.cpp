#include "perception/overlap_score.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

namespace dofusion {
namespace {

// Hungarian algorithm (shortest augmenting paths): for each row of a cost matrix with rows <= columns its column, for
// the least sum.
std::vector<int> assign(const Eigen::MatrixXd& cost) {
  const int rows = static_cast<int>(cost.rows()), columns = static_cast<int>(cost.cols());
  std::vector<double> row_price(rows + 1, 0.0), column_price(columns + 1, 0.0);
  std::vector<int> row_of(columns + 1, 0);
  for (int row = 1; row <= rows; ++row) {
    row_of[0] = row;
    int column = 0;
    std::vector<double> slack(columns + 1, std::numeric_limits<double>::infinity());
    std::vector<int> previous(columns + 1, 0);
    std::vector<bool> used(columns + 1, false);
    do {
      used[column] = true;
      int next = 0;
      double least = std::numeric_limits<double>::infinity();
      for (int c = 1; c <= columns; ++c) {
        if (used[c]) continue;
        const double reduced = cost(row_of[column] - 1, c - 1) - row_price[row_of[column]] - column_price[c];
        if (reduced < slack[c]) slack[c] = reduced, previous[c] = column;
        if (slack[c] < least) least = slack[c], next = c;
      }
      for (int c = 0; c <= columns; ++c) {
        if (used[c]) {
          row_price[row_of[c]] += least;
          column_price[c] -= least;
        } else {
          slack[c] -= least;
        }
      }
      column = next;
    } while (row_of[column] != 0);
    while (column != 0) {
      row_of[column] = row_of[previous[column]];
      column = previous[column];
    }
  }
  std::vector<int> column_of(rows, -1);
  for (int c = 1; c <= columns; ++c) {
    if (row_of[c] > 0) column_of[row_of[c] - 1] = c - 1;
  }
  return column_of;
}

int objects_in(const LabelImage& labels) {
  const auto largest = std::max_element(labels.pixels.begin(), labels.pixels.end());
  return largest == labels.pixels.end() ? 0 : std::max(0, *largest - 1);
}

double f_measure(double precision, double recall) {
  return precision + recall > 0.0 ? 2.0 * precision * recall / (precision + recall) : 0.0;
}

// Pixels of an object with a 4-neighbour of another label.
LabelImage boundaries(const LabelImage& labels) {
  LabelImage result(labels.width, labels.height, 0);
  for (int v = 0; v < labels.height; ++v) {
    for (int u = 0; u < labels.width; ++u) {
      const std::uint8_t label = labels.at(v, u);
      if (label < kLabelFirstObject) continue;
      for (const auto& [dv, du] : {std::pair{0, 1}, {0, -1}, {1, 0}, {-1, 0}}) {
        if (!labels.contains(v + dv, u + du) || labels.at(v + dv, u + du) != label) result.at(v, u) = label;
      }
    }
  }
  return result;
}

// Boundary pixels of object `label` in `of` that have one of object `other` in `to` within `reach` pixels.
int near_boundary(const LabelImage& of, std::uint8_t label, const LabelImage& to, std::uint8_t other, int reach) {
  int count = 0;
  for (int v = 0; v < of.height; ++v) {
    for (int u = 0; u < of.width; ++u) {
      if (of.at(v, u) != label) continue;
      bool near = false;
      for (int y = std::max(0, v - reach); y <= std::min(of.height - 1, v + reach) && !near; ++y) {
        for (int x = std::max(0, u - reach); x <= std::min(of.width - 1, u + reach) && !near; ++x) {
          near = to.at(y, x) == other && (y - v) * (y - v) + (x - u) * (x - u) <= reach * reach;
        }
      }
      count += near;
    }
  }
  return count;
}

int count_labelled(const LabelImage& labels) {
  return static_cast<int>(
      std::count_if(labels.pixels.begin(), labels.pixels.end(), [](std::uint8_t l) { return l >= kLabelFirstObject; }));
}

}  // namespace

OverlapScore score_segmentation(const LabelImage& found_all, const LabelImage& truth, int boundary_px) {
  if (found_all.width != truth.width || found_all.height != truth.height) {
    throw std::invalid_argument("segmentations of different sizes");
  }
  LabelImage found = found_all;
  for (std::size_t p = 0; p < found.pixels.size(); ++p) {
    if (truth.pixels[p] == kLabelNothing) found.pixels[p] = kLabelNothing;
  }
  OverlapScore score{objects_in(found_all), objects_in(truth), 0.0, 0.0};
  if (score.found == 0 && score.true_objects == 0) return {0, 0, 1.0, 1.0};
  if (score.found == 0 || score.true_objects == 0) return score;

  // Square, so that objects may stay unmatched.
  const int n = std::max(score.found, score.true_objects);
  Eigen::MatrixXd common = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd found_pixels = Eigen::VectorXd::Zero(n), true_pixels = Eigen::VectorXd::Zero(n);
  for (std::size_t p = 0; p < found.pixels.size(); ++p) {
    const int i = found.pixels[p] - kLabelFirstObject, j = truth.pixels[p] - kLabelFirstObject;
    if (i >= 0) found_pixels[i] += 1.0;
    if (j >= 0) true_pixels[j] += 1.0;
    if (i >= 0 && j >= 0) common(i, j) += 1.0;
  }
  Eigen::MatrixXd cost = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double total = found_pixels[i] + true_pixels[j];
      if (total > 0.0) cost(i, j) = -2.0 * common(i, j) / total;
    }
  }
  const std::vector<int> match = assign(cost);
  const LabelImage found_border = boundaries(found), true_border = boundaries(truth);
  double overlap = 0.0, found_near = 0.0, true_near = 0.0;
  for (int i = 0; i < n; ++i) {
    if (common(i, match[i]) <= 0.0) continue;
    const auto c = static_cast<std::uint8_t>(kLabelFirstObject + i);
    const auto g = static_cast<std::uint8_t>(kLabelFirstObject + match[i]);
    overlap += common(i, match[i]);
    found_near += near_boundary(found_border, c, true_border, g, boundary_px);
    true_near += near_boundary(true_border, g, found_border, c, boundary_px);
  }
  score.overlap_f = f_measure(overlap / std::max(1.0, found_pixels.sum()), overlap / std::max(1.0, true_pixels.sum()));
  score.boundary_f = f_measure(found_near / std::max(1, count_labelled(found_border)),
                               true_near / std::max(1, count_labelled(true_border)));
  return score;
}

}  // namespace dofusion
