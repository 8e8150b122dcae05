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
Displacement displacement(const std::vector<double>& diameters, const std::vector<Pose>& before,
                          const std::vector<Pose>& after);
std::vector<double> diameters_of(const std::vector<ObjectPtr>& objects);

// Nothing moved more than 10 % of its diameter or 10 degrees.
inline constexpr double kStableTranslationPct = 10.0;
inline constexpr double kStableRotationDeg = 10.0;
bool is_stable(const Displacement& displacement);

// The largest angle between what was upright of an object before and what is after; turning about the vertical does
// not count.
double largest_tilt_deg(const std::vector<Pose>& before, const std::vector<Pose>& after);
inline constexpr double kTiltedDeg = 20.0;         // beyond this an object has been tilted
inline constexpr double kQuietRotationDeg = 10.0;  // accumulated rotation below which a scene has stayed quiet

double median(std::vector<double> values);  // NaN if empty

struct Interval {
  double low = 0.0, high = 0.0;
};
// Bootstrap 95 % interval of the median (or of the mean) of `values`.
Interval bootstrap_median(const std::vector<double>& values, Rng& rng, int resamples = 1000);
Interval bootstrap_mean(const std::vector<double>& values, Rng& rng, int resamples = 1000);

}  // namespace dofusion
