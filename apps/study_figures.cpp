#include "apps/study_figures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "apps/svg_plot.h"

namespace dofusion {
namespace {

// Okabe and Ito's colours, which the colour-blind can tell apart.
constexpr const char* kBlue = "#0072B2";
constexpr const char* kVermilion = "#D55E00";
constexpr const char* kGreen = "#007A5A";
constexpr const char* kPurple = "#AA4499";
constexpr const char* kAmber = "#E69F00";
constexpr const char* kSky = "#56B4E9";
constexpr const char* kGrey = "#555555";

constexpr double kDisplayFloor = 0.001;  // per cent or degrees; less is nothing that could be measured on a table

std::string one_decimal(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.1f", value);
  return buffer;
}

std::vector<PlotPart> failure_parts() {
  static const std::vector<std::string> colours = {"#222222", kBlue, kSky, kAmber, kVermilion};
  std::vector<PlotPart> parts;
  for (std::size_t i = 0; i < failure_titles().size(); ++i) {
    parts.push_back({failure_titles()[i], colours[i], i % 2 == 1});
  }
  return parts;
}

// Limits a little beside the first and the last tick.
void with_margins(PlotAxis& axis) {
  const double first = axis.ticks.front().at, last = axis.ticks.back().at;
  const double margin = last > first ? 0.06 * (last - first) : 0.5;
  axis.low = first - margin;
  axis.high = last + margin;
}

PlotAxis noise_axis(const StudySummary& summary, const StudyConfig& config) {
  PlotAxis axis;
  axis.title = "noise scale of " + sensor_title(config.base().sensor) + "; below: depth σ at " +
               plain(config.base().distance_m) + " m";
  for (const StudyPoint& p : summary.base()) {
    axis.ticks.push_back(
        {p.noise_scale, plain(p.noise_scale), (p.depth_sigma_mm == 0.0 ? "0" : one_decimal(p.depth_sigma_mm)) + " mm"});
  }
  with_margins(axis);
  return axis;
}

using EstimateOf = std::function<const Estimate&(const StudyPoint&)>;

PlotCurve curve_of(const std::vector<StudyPoint>& points, const std::string& name, const char* colour, Marker marker,
                   const EstimateOf& estimate, double factor = 1.0) {
  PlotCurve curve{name, colour, marker, {}};
  for (const StudyPoint& p : points) {
    const Estimate& e = estimate(p);
    curve.points.push_back({p.noise_scale, factor * e.value, factor * e.interval.low, factor * e.interval.high});
  }
  return curve;
}

PlotReference reference_of(const std::string& name, const char* colour, const char* dashes, const Estimate& e,
                           double factor = 1.0) {
  return {name, colour, dashes, factor * e.value, factor * e.interval.low, factor * e.interval.high};
}

// A decade above all that is drawn.
double top_decade(const PlotPanel& panel) {
  double largest = 10.0;
  const auto include = [&](double value) {
    if (std::isfinite(value)) largest = std::max(largest, value);
  };
  for (const PlotCurve& curve : panel.curves)
    for (const PlotPoint& p : curve.points) include(p.y), include(p.high);
  for (const PlotReference& r : panel.references) include(r.y), include(r.high);
  return std::pow(10.0, std::ceil(std::log10(largest * 1.001)));
}

PlotPanel displacement_panel(const StudySummary& summary, const StudyConfig& config, bool translation) {
  const std::string unit = translation ? "_pct" : "_deg";
  const auto median_of = [&](const std::string& scene) {
    return [column = "displacement_" + scene + unit](const StudyPoint& p) -> const Estimate& {
      return p.medians.at(column);
    };
  };
  const auto reference = [&](const StudyReference& r) { return translation ? r.pct : r.deg; };
  PlotPanel panel;
  panel.title = translation ? "Translation" : "Rotation";
  panel.x = noise_axis(summary, config);
  panel.curves = {curve_of(summary.base(), "in the recovered scene", kBlue, Marker::kCircle, median_of("recovered")),
                  curve_of(summary.base(), "in the true scene", kVermilion, Marker::kSquare, median_of("true"))};
  panel.references = {reference_of("true scene given to the model", kGreen, "9 4", reference(summary.ground_truth)),
                      reference_of("random placement", kGrey, "2 4", reference(summary.random))};
  panel.limits = {{10.0, translation ? "limit of stable: 10 %" : "limit of stable: 10°"}};
  panel.y = log_axis(translation ? "median displacement, % of the diameter" : "median displacement, degrees",
                     kDisplayFloor, top_decade(panel));
  return panel;
}

PlotAxis share_axis(const std::string& title) {
  PlotAxis axis{title, -4.0, 104.0, false, {}};
  for (int pct = 0; pct <= 100; pct += 20) axis.ticks.push_back({static_cast<double>(pct), std::to_string(pct), ""});
  return axis;
}

PlotPanel success_panel(const StudySummary& summary, const StudyConfig& config) {
  PlotPanel panel;
  panel.title = "Scenes recovered, placements that stand";
  panel.x = noise_axis(summary, config);
  panel.y = share_axis("share of the trials, %");
  const auto share = [](const char* name) {
    return [name](const StudyPoint& p) -> const Estimate& { return p.shares.at(name); };
  };
  const char* recovery = config.base().known ? "all objects recovered, shapes right" : "number of objects right";
  panel.curves = {
      curve_of(summary.base(), recovery, kPurple, Marker::kDiamond,
               share(config.base().known ? "shapes_right" : "objects_right"), 100.0),
      curve_of(summary.base(), "stands in the recovered scene", kBlue, Marker::kCircle, share("stable_recovered"),
               100.0),
      curve_of(summary.base(), "stands in the true scene", kVermilion, Marker::kSquare, share("stable_true"), 100.0)};
  panel.references = {reference_of("true scene given to the model", kGreen, "9 4", summary.ground_truth.stable, 100.0),
                      reference_of("random placement", kGrey, "2 4", summary.random.stable, 100.0)};
  return panel;
}

PlotPanel failure_panel(const StudySummary& summary, const StudyConfig& config) {
  PlotPanel panel;
  panel.title = "What failed first";
  panel.x = noise_axis(summary, config);
  panel.parts = failure_parts();
  // Bars stand side by side, whatever the scales.
  panel.x.low = -0.6;
  panel.x.high = static_cast<double>(summary.base().size()) - 0.4;
  double highest = 0.0;
  for (std::size_t i = 0; i < summary.base().size(); ++i) {
    PlotBar bar{static_cast<double>(i), {}};
    double sum = 0.0;
    for (const std::string& failure : failure_names()) {
      bar.parts.push_back(100.0 * summary.base()[i].failures.at(failure));
      sum += bar.parts.back();
    }
    highest = std::max(highest, sum);
    panel.bars.push_back(bar);
    panel.x.ticks[i].at = bar.x;
  }
  panel.y = share_axis("share of the trials, %");
  const double step = highest <= 10.0 ? 2.0 : highest <= 25.0 ? 5.0 : highest <= 50.0 ? 10.0 : 20.0;
  panel.y.low = 0.0;
  panel.y.high = std::max(step * std::ceil(highest / step), 2.0 * step);
  panel.y.ticks.clear();
  for (double at = 0.0; at <= panel.y.high + 1e-9; at += step) panel.y.ticks.push_back({at, plain(at), ""});
  return panel;
}

// What the series make of the true scene: the share that stands, or the median translation.
PlotPanel series_panel(const StudySummary& summary, bool success) {
  PlotPanel panel;
  panel.title = success ? "Placements that stand in the true scene" : "Translation in the true scene";
  static const std::vector<const char*> colours = {kVermilion, kBlue, kGreen, kPurple, kAmber, kSky, kGrey};
  const EstimateOf estimate = [success](const StudyPoint& p) -> const Estimate& {
    return success ? p.shares.at("stable_true") : p.medians.at("displacement_true_pct");
  };
  for (std::size_t i = 0; i < summary.series.size(); ++i) {
    const StudySeries& series = summary.series[i];
    panel.curves.push_back(curve_of(series.points, series.title, colours[i % colours.size()],
                                    static_cast<Marker>(i % 3), estimate, success ? 100.0 : 1.0));
  }
  panel.x.title = "noise scale";
  for (const StudyPoint& p : summary.base()) panel.x.ticks.push_back({p.noise_scale, plain(p.noise_scale), ""});
  with_margins(panel.x);
  panel.y = success ? share_axis("share of the trials, %")
                    : log_axis("median displacement, % of the diameter", kDisplayFloor, top_decade(panel));
  return panel;
}

std::string trials_per_scale(const StudySummary& summary) {
  int fewest = summary.trials, most = 0;
  for (const StudyPoint& p : summary.base()) {
    fewest = std::min(fewest, p.trials);
    most = std::max(most, p.trials);
  }
  return fewest == most ? std::to_string(most) : std::to_string(fewest) + " to " + std::to_string(most);
}

}  // namespace

std::string plain(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%g", value);
  return buffer;
}

const std::vector<std::string>& failure_titles() {
  static const std::vector<std::string> titles = {"no table", "number of objects", "shape", "pose", "placement"};
  return titles;
}

std::string displacement_svg(const StudySummary& summary, const StudyConfig& config) {
  return draw_figure({displacement_panel(summary, config, true), displacement_panel(summary, config, false)},
                     {"Median over " + trials_per_scale(summary) + " trials a noise scale, " +
                          std::to_string(summary.trials) + " in all (references: " + std::to_string(summary.scenes) +
                          " scenes); bands: 95 % bootstrap intervals of the median.",
                      "The largest displacement over all objects while the scene settles with the placed object. "
                      "Smaller values than " +
                          plain(kDisplayFloor) + " are drawn there."});
}

std::string series_svg(const StudySummary& summary) {
  return draw_figure({series_panel(summary, true), series_panel(summary, false)},
                     {"All series on the same scenes, against the noise scale of each one's own sensor; bands: 95 % "
                      "bootstrap intervals."});
}

std::string success_svg(const StudySummary& summary, const StudyConfig& config) {
  return draw_figure(
      {success_panel(summary, config), failure_panel(summary, config)},
      {trials_per_scale(summary) + " trials a noise scale; bands: 95 % bootstrap intervals. A placement stands if "
                                   "nothing moves more than 10 % of its diameter and 10°.",
       "Right: trials whose placement does not stand in the true scene, by the first step that went wrong."});
}

}  // namespace dofusion
