#include "stability/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <Eigen/Geometry>

namespace dofusion {
namespace {

template <class Statistic>
Interval bootstrap(const std::vector<double>& values, Rng& rng, int resamples, Statistic statistic) {
  if (values.empty()) return {std::nan(""), std::nan("")};
  std::vector<double> statistics, resample(values.size());
  for (int i = 0; i < resamples; ++i) {
    for (double& value : resample) {
      value = values[static_cast<std::size_t>(uniform_int(rng, 0, static_cast<int>(values.size()) - 1))];
    }
    statistics.push_back(statistic(resample));
  }
  std::sort(statistics.begin(), statistics.end());
  const auto quantile = [&](double q) { return statistics[static_cast<std::size_t>(q * (statistics.size() - 1))]; };
  return {quantile(0.025), quantile(0.975)};
}

}  // namespace

std::vector<double> diameters_of(const std::vector<ObjectPtr>& objects) {
  std::vector<double> diameters;
  for (const ObjectPtr& object : objects) diameters.push_back(object->diameter);
  return diameters;
}

Displacement displacement(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& before,
                          const std::vector<Pose>& after) {
  return displacement(diameters_of(objects), before, after);
}

Displacement displacement(const std::vector<double>& diameters, const std::vector<Pose>& before,
                          const std::vector<Pose>& after) {
  if (before.size() != diameters.size() || after.size() != diameters.size()) {
    throw std::invalid_argument("displacement needs one pose per object");
  }
  Displacement largest;
  for (std::size_t i = 0; i < diameters.size(); ++i) {
    const double moved = (after[i].translation() - before[i].translation()).norm();
    const double turned = rotation_angle(before[i].linear().transpose() * after[i].linear());
    largest.translation_pct = std::max(largest.translation_pct, 100.0 * moved / diameters[i]);
    largest.rotation_deg = std::max(largest.rotation_deg, turned * 180.0 / M_PI);
  }
  return largest;
}

double largest_tilt_deg(const std::vector<Pose>& before, const std::vector<Pose>& after) {
  if (before.size() != after.size()) throw std::invalid_argument("tilt needs as many poses after as before");
  double largest = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    // The vertical in the object's frame, before and after.
    const Eigen::Vector3d up = before[i].linear().row(2).transpose(), now = after[i].linear().row(2).transpose();
    largest = std::max(largest, std::atan2(up.cross(now).norm(), up.dot(now)) * 180.0 / M_PI);
  }
  return largest;
}

bool is_stable(const Displacement& d) {
  return d.translation_pct < kStableTranslationPct && d.rotation_deg < kStableRotationDeg;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2.0;
}

Interval bootstrap_median(const std::vector<double>& values, Rng& rng, int resamples) {
  return bootstrap(values, rng, resamples, [](const std::vector<double>& v) { return median(v); });
}

Interval bootstrap_mean(const std::vector<double>& values, Rng& rng, int resamples) {
  return bootstrap(values, rng, resamples, [](const std::vector<double>& v) {
    return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
  });
}

}  // namespace dofusion
