// How far a scene moved while it settled: the paper's displacement metrics.
#pragma once

#include <vector>

#include "stability/scene.h"

namespace dofusion {

// Section "Evaluating a generated pose": the largest over all objects, context and query.
struct Displacement {
  double translation_pct = 0.0;  // distance between initial and settled position, per cent of the object's diameter
  double rotation_deg = 0.0;     // angle of the relative rotation
};

Displacement displacement(const std::vector<ObjectPtr>& objects, const std::vector<Pose>& before,
                          const std::vector<Pose>& after);

// Nothing moved more than 10 % of its diameter or 10 degrees.
inline constexpr double kStableTranslationPct = 10.0;
inline constexpr double kStableRotationDeg = 10.0;
bool is_stable(const Displacement& displacement);

double median(std::vector<double> values);  // NaN if empty

struct Interval {
  double low = 0.0, high = 0.0;
};
// Bootstrap 95 % interval of the median (or of the mean) of `values`.
Interval bootstrap_median(const std::vector<double>& values, Rng& rng, int resamples = 1000);
Interval bootstrap_mean(const std::vector<double>& values, Rng& rng, int resamples = 1000);

}  // namespace dofusion
