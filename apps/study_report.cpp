#include "apps/study_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>

#include "apps/html.h"
#include "apps/svg_plot.h"
#include "stability/files.h"

namespace dofusion {
namespace {

// Okabe and Ito's colours, which the colour-blind can tell apart.
constexpr const char* kBlue = "#0072B2";
constexpr const char* kVermilion = "#D55E00";
constexpr const char* kGreen = "#007A5A";
constexpr const char* kGrey = "#555555";

constexpr double kDisplayFloor = 0.001;  // per cent or degrees; less is nothing that could be measured on a table

std::string number(double value) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return "∞";
  if (value > 0.0 && value < 0.001) return "<0.001";
  char buffer[32];
  const int digits = value == 0.0 || value >= 99.95 ? 0 : value < 0.1 ? 3 : value < 10.0 ? 2 : 1;
  std::snprintf(buffer, sizeof buffer, "%.*f", digits, value);
  return buffer;
}

std::string plain(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%g", value);
  return buffer;
}

std::string one_decimal(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.1f", value);
  return buffer;
}

std::string sensor_title(SensorModel sensor) {
  switch (sensor) {
    case SensorModel::kNone: return "an exact sensor";
    case SensorModel::kKinect: return "the first Kinect";
    case SensorModel::kKinect2: return "the Kinect v2";
    case SensorModel::kRealsense: return "the RealSense D435";
    case SensorModel::kAzure: return "the Azure Kinect";
  }
  return "";
}

std::string tasks_text(const StudyConfig& config) {
  std::string list;
  for (const StudyTask& task : config.tasks) {
    if (!list.empty()) list += ", ";
    if (task.task == Task::kSingle) list += "one block";
    else list += std::to_string(task.objects) + (task.task == Task::kStack ? " stacked blocks" : " blocks touching or side by side");
  }
  return list;
}

PlotAxis noise_axis(const StudySummary& summary, const StudyConfig& config) {
  PlotAxis axis;
  axis.title = "noise scale of " + sensor_title(config.sensor) + "; below: depth σ at " + plain(config.distance_m) + " m";
  for (const StudyPoint& p : summary.points) {
    axis.ticks.push_back({p.noise_scale, plain(p.noise_scale), (p.depth_sigma_mm == 0.0 ? "0" : one_decimal(p.depth_sigma_mm)) + " mm"});
  }
  const double first = axis.ticks.front().at, last = axis.ticks.back().at;
  const double margin = last > first ? 0.06 * (last - first) : 0.5;
  axis.low = first - margin;
  axis.high = last + margin;
  return axis;
}

PlotCurve curve_of(const StudySummary& summary, const std::string& name, const char* colour, Marker marker,
                   const std::function<const Estimate&(const StudyPoint&)>& estimate, double factor = 1.0) {
  PlotCurve curve{name, colour, marker, {}};
  for (const StudyPoint& p : summary.points) {
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
    return [column = "displacement_" + scene + unit](const StudyPoint& p) -> const Estimate& { return p.medians.at(column); };
  };
  const auto reference = [&](const StudyReference& r) { return translation ? r.pct : r.deg; };
  PlotPanel panel;
  panel.title = translation ? "Translation" : "Rotation";
  panel.x = noise_axis(summary, config);
  panel.curves = {curve_of(summary, "in the recovered scene", kBlue, Marker::kCircle, median_of("recovered")),
                  curve_of(summary, "in the true scene", kVermilion, Marker::kSquare, median_of("true"))};
  panel.references = {
      reference_of("true scene given to the model", kGreen, "9 4", reference(summary.ground_truth)),
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
  panel.title = "Placements that stand";
  panel.x = noise_axis(summary, config);
  panel.y = share_axis("share of the trials, %");
  const auto share = [](const char* name) {
    return [name](const StudyPoint& p) -> const Estimate& { return p.shares.at(name); };
  };
  panel.curves = {
      curve_of(summary, "in the recovered scene", kBlue, Marker::kCircle, share("stable_recovered"), 100.0),
      curve_of(summary, "in the true scene", kVermilion, Marker::kSquare, share("stable_true"), 100.0)};
  panel.references = {
      reference_of("true scene given to the model", kGreen, "9 4", summary.ground_truth.stable, 100.0),
      reference_of("random placement", kGrey, "2 4", summary.random.stable, 100.0)};
  return panel;
}

const std::vector<PlotPart>& failure_parts() {  // in the order of failure_names()
  static const std::vector<PlotPart> parts = {{"no table", "#222222", false},
                                              {"number of objects", "#0072B2", true},
                                              {"shape", "#56B4E9", false},
                                              {"pose", "#E69F00", true},
                                              {"placement", "#D55E00", false}};
  return parts;
}

PlotPanel failure_panel(const StudySummary& summary, const StudyConfig& config) {
  PlotPanel panel;
  panel.title = "What failed first";
  panel.x = noise_axis(summary, config);
  panel.parts = failure_parts();
  // Bars stand side by side, whatever the scales.
  panel.x.low = -0.6;
  panel.x.high = static_cast<double>(summary.points.size()) - 0.4;
  double highest = 0.0;
  for (std::size_t i = 0; i < summary.points.size(); ++i) {
    PlotBar bar{static_cast<double>(i), {}};
    double sum = 0.0;
    for (const std::string& failure : failure_names()) {
      bar.parts.push_back(100.0 * summary.points[i].failures.at(failure));
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

std::string trials_per_scale(const StudySummary& summary) {
  int fewest = summary.trials, most = 0;
  for (const StudyPoint& p : summary.points) {
    fewest = std::min(fewest, p.trials);
    most = std::max(most, p.trials);
  }
  return fewest == most ? std::to_string(most) : std::to_string(fewest) + " to " + std::to_string(most);
}

std::string cell(const Estimate& e, double factor = 1.0) {
  if (e.count == 0) return "<td>–</td>";
  return "<td>" + html_escaped(number(factor * e.value)) + " <small>" + html_escaped(number(factor * e.interval.low)) +
         " … " + html_escaped(number(factor * e.interval.high)) + "</small></td>";
}

struct TableRow {
  const char* title;
  const char* name;
  bool is_share;
};

const std::vector<TableRow>& table_rows() {
  static const std::vector<TableRow> rows = {
      {"Placements that stand in the recovered scene, %", "stable_recovered", true},
      {"Placements that stand in the true scene, %", "stable_true", true},
      {"Displacement in the recovered scene, %", "displacement_recovered_pct", false},
      {"Displacement in the true scene, %", "displacement_true_pct", false},
      {"Displacement in the recovered scene, °", "displacement_recovered_deg", false},
      {"Displacement in the true scene, °", "displacement_true_deg", false},
      {"Trials with the right number of objects, %", "objects_right", true},
      {"Trials with all shapes right, %", "shapes_right", true},
      {"Position error, worst object, mm", "position_error_max_mm", false},
      {"Pose error, worst object, % of its diameter", "pose_error_max_pct", false},
      {"Table's angle error, °", "table_angle_deg", false},
      {"Table's offset, mm", "table_offset_mm", false},
      {"Time to recover the scene, ms", "ms_recover", false},
      {"Time to place, ms", "ms_place", false}};
  return rows;
}

std::string summary_table(const StudySummary& summary) {
  std::string html = "<div class=\"wide\"><table>\n<thead><tr><th>Noise scale</th>";
  for (const StudyPoint& p : summary.points) html += "<th>" + plain(p.noise_scale) + "</th>";
  html += "</tr>\n<tr><td>Depth σ, mm</td>";
  for (const StudyPoint& p : summary.points) html += "<td>" + number(p.depth_sigma_mm) + "</td>";
  html += "</tr>\n<tr><td>Trials</td>";
  for (const StudyPoint& p : summary.points) html += "<td>" + std::to_string(p.trials) + "</td>";
  html += "</tr></thead>\n<tbody>\n";
  for (const TableRow& row : table_rows()) {
    html += std::string("<tr><td>") + row.title + "</td>";
    for (const StudyPoint& p : summary.points) {
      html += row.is_share ? cell(p.shares.at(row.name), 100.0) : cell(p.medians.at(row.name));
    }
    html += "</tr>\n";
  }
  for (std::size_t i = 0; i < failure_names().size(); ++i) {
    html += "<tr><td>Failed first: " + failure_parts()[i].name + ", %</td>";
    for (const StudyPoint& p : summary.points) html += "<td>" + number(100.0 * p.failures.at(failure_names()[i])) + "</td>";
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string reference_table(const StudySummary& summary) {
  const auto row = [](const char* title, const StudyReference& r) {
    return std::string("<tr><td>") + title + "</td>" + cell(r.stable, 100.0) + cell(r.pct) + cell(r.deg) + "</tr>\n";
  };
  return "<div class=\"wide\"><table>\n<thead><tr><th>Reference</th><th>stand, %</th><th>displacement, %</th>"
         "<th>displacement, °</th></tr></thead>\n<tbody>" +
         row("True scene given to the model", summary.ground_truth) + row("Random placement", summary.random) +
         "</tbody></table></div>\n";
}

// Besides the reports' common style: tables that scroll on a narrow screen, and what print needs.
constexpr const char* kStyle = R"(<style>
  figure { margin: 14px 0; overflow-x: auto; } figure svg { width: 100%; min-width: 640px; height: auto; } .wide { overflow-x: auto; }
  td { white-space: nowrap; } td:first-child { white-space: normal; min-width: 13em; } td small { color: var(--soft); }
  thead tr:last-child > * { border-bottom: 2px solid var(--ink); } table { margin: 10px 0 18px; }
  @media print { body { background: none; } main { padding: 0; } h2 { break-after: avoid; }
                 figure, table { break-inside: avoid; } figure svg { min-width: 0; } }
</style>
)";

std::string lead(const StudySummary& summary, const StudyConfig& config) {
  const StudyPoint& first = summary.points.front();
  const StudyPoint& last = summary.points.back();
  const auto clause = [](const StudyPoint& p) {
    const std::string noise = p.noise_scale == 0.0   ? "without noise"
                              : p.noise_scale == 1.0 ? "at the sensor's own noise"
                                                     : "at " + plain(p.noise_scale) + " times the sensor's noise";
    return number(100.0 * p.shares.at("stable_true").value) + " % of the placements stand in the true scene " + noise;
  };
  return "<p class=\"lead\">" + std::to_string(summary.trials) + " trials on " + std::to_string(summary.scenes) + " scenes, one view with " +
         sensor_title(config.sensor) + " at " + plain(config.distance_m) + " m, objects " +
         (config.known ? "known" : "unknown") + ". " + clause(first) +
         (summary.points.size() > 1 ? "; " + clause(last) : "") + ".</p>\n";
}

std::string method(const StudyConfig& config, std::uint64_t seed) {
  return "<p>Every trial runs the whole chain. A stable scene is generated (in turn: " + tasks_text(config) +
         "), scanned from a random viewpoint 30° to 60° above the table, and recovered from that one depth image: table, "
         "segmentation, " + (config.known ? "which of the seven blocks stand where" : "the shapes and poses of unknown objects") +
         ". For one more block the model draws " + std::to_string(config.samples) + " poses in " +
         std::to_string(config.steps) + " steps; they are settled in the recovered scene and the best-ranked one is taken. "
         "Its pose relative to the camera, which is what a robot has, is then put into the <em>true</em> scene and "
         "settled there. Trials of one scene share viewpoint, query and all seeds and differ in the noise alone. "
         "Seed " + std::to_string(seed) + ".</p>\n"
         "<p>A displacement is the largest over all objects, context and query: translation in per cent of that object's "
         "diameter, and rotation. A placement stands if the scene comes to rest with both under 10 % and 10°. A trial "
         "without a displacement (no table was found, or the simulation diverged) counts as larger than any. A candidate "
         "that stands is replaced by the pose at which it came to rest, so that in the scene it was made for, the recovered "
         "one, next to nothing is left to move. "
         "What failed first is told of trials whose placement does not stand in the true scene: no table; a wrong number "
         "of objects; a known object taken for another; an object off by more than " + plain(kPoseErrorPct) +
         " % of its diameter; or, with all that right, the placement itself.</p>\n"
         "<p>Intervals are 95 % bootstrap intervals over the trials; one of zero width means that all trials agreed. "
         "All trials are in <code>trials.csv</code>, these numbers in <code>summary.json</code>.</p>\n";
}

}  // namespace

std::string trials_csv(const std::vector<StudyRow>& rows) {
  std::string csv = csv_header();
  for (const StudyRow& row : rows) csv += to_csv_line(row);
  return csv;
}

std::string displacement_svg(const StudySummary& summary, const StudyConfig& config) {
  return draw_figure(
      {displacement_panel(summary, config, true), displacement_panel(summary, config, false)},
      {"Median over " + trials_per_scale(summary) + " trials a noise scale, " + std::to_string(summary.trials) + " in all (references: " +
           std::to_string(summary.scenes) + " scenes); bands: 95 % bootstrap intervals of the median.",
       "The largest displacement over all objects while the scene settles with the placed object. Smaller values than " +
           plain(kDisplayFloor) + " are drawn there."});
}

std::string success_svg(const StudySummary& summary, const StudyConfig& config) {
  return draw_figure({success_panel(summary, config), failure_panel(summary, config)},
                     {trials_per_scale(summary) + " trials a noise scale; bands: 95 % bootstrap intervals. A placement stands if "
                      "nothing moves more than 10 % of its diameter and 10°.",
                      "Right: trials whose placement does not stand in the true scene, by the first step that went wrong."});
}

std::string study_html(const StudySummary& summary, const StudyConfig& config, std::uint64_t seed) {
  const std::string title = "What sensor noise costs a placement";
  return html_begin(title) + kStyle + "<h1>" + title + "</h1>\n" + lead(summary, config) +
         "<h2>Displacement against noise</h2>\n<figure>" + displacement_svg(summary, config) + "</figure>\n" +
         "<h2>Success, and what fails</h2>\n<figure>" + success_svg(summary, config) + "</figure>\n" +
         "<h2>In numbers</h2>\n<p>Shares, and medians with their 95 % intervals.</p>\n" + summary_table(summary) +
         reference_table(summary) + "<h2>What was done</h2>\n" + method(config, seed) + html_end();
}

void write_study(const std::string& directory, const std::vector<StudyRow>& rows, const StudySummary& summary,
                 const StudyConfig& config, const std::string& settings, std::uint64_t seed) {
  write_file(directory + "/trials.csv", trials_csv(rows));
  write_file(directory + "/summary.json", to_json(summary, settings).dump(2) + "\n");
  write_file(directory + "/displacement.svg", displacement_svg(summary, config));
  write_file(directory + "/report.html", study_html(summary, config, seed));
}

std::string study_text(const StudySummary& summary) {
  std::string out;
  char line[200];
  std::snprintf(line, sizeof line, "%-12s %7s %16s %16s %22s\n", "noise scale", "trials", "true disp. (%)", "true disp. (deg)",
                "stand, recovered/true");
  out += line;
  const auto add = [&](const std::string& name, int trials, const Estimate& pct, const Estimate& deg, const std::string& stand) {
    std::snprintf(line, sizeof line, "%-12s %7d %16s %16s %22s\n", name.c_str(), trials, number(pct.value).c_str(),
                  number(deg.value).c_str(), stand.c_str());
    out += line;
  };
  for (const StudyPoint& p : summary.points) {
    add(plain(p.noise_scale), p.trials, p.medians.at("displacement_true_pct"), p.medians.at("displacement_true_deg"),
        number(100.0 * p.shares.at("stable_recovered").value) + " / " + number(100.0 * p.shares.at("stable_true").value) + " %");
  }
  const auto reference = [&](const char* name, const StudyReference& r) {
    add(name, summary.scenes, r.pct, r.deg, number(100.0 * r.stable.value) + " %");
  };
  reference("true scene", summary.ground_truth);
  reference("random", summary.random);
  return out;
}

}  // namespace dofusion
