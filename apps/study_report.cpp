#include "apps/study_report.h"

#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "apps/html.h"
#include "apps/study_figures.h"
#include "stability/files.h"

namespace dofusion {
namespace {

std::string number(double value) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return "∞";
  if (value > 0.0 && value < 0.001) return "<0.001";
  char buffer[32];
  const int digits = value == 0.0 || value >= 99.95 ? 0 : value < 0.1 ? 3 : value < 10.0 ? 2 : 1;
  std::snprintf(buffer, sizeof buffer, "%.*f", digits, value);
  return buffer;
}

std::string tasks_text(const StudyConfig& config) {
  std::string list;
  for (const StudyTask& task : config.tasks) list += (list.empty() ? "" : "; ") + task_title(task);
  return list;
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
      {"Trials with all objects and shapes right, %", "shapes_right", true},
      {"Position error, worst object, mm", "position_error_max_mm", false},
      {"Pose error, worst object, % of its diameter", "pose_error_max_pct", false},
      {"Table's angle error, °", "table_angle_deg", false},
      {"Table's offset, mm", "table_offset_mm", false},
      {"Time to recover the scene, ms", "ms_recover", false},
      {"Time to place, ms", "ms_place", false}};
  return rows;
}

std::string summary_table(const std::vector<StudyPoint>& points) {
  std::string html = "<div class=\"scroll\"><table>\n<thead><tr><th>Noise scale</th>";
  for (const StudyPoint& p : points) html += "<th>" + plain(p.noise_scale) + "</th>";
  html += "</tr>\n<tr><td>Depth σ, mm</td>";
  for (const StudyPoint& p : points) html += "<td>" + number(p.depth_sigma_mm) + "</td>";
  html += "</tr>\n<tr><td>Trials</td>";
  for (const StudyPoint& p : points) html += "<td>" + std::to_string(p.trials) + "</td>";
  html += "</tr></thead>\n<tbody>\n";
  for (const TableRow& row : table_rows()) {
    html += std::string("<tr><td>") + row.title + "</td>";
    for (const StudyPoint& p : points) {
      html += row.is_share ? cell(p.shares.at(row.name), 100.0) : cell(p.medians.at(row.name));
    }
    html += "</tr>\n";
  }
  const auto& tasks = points.front().stable_by_task;
  for (auto task = tasks.begin(); tasks.size() > 1 && task != tasks.end(); ++task) {
    html += "<tr><td>Stand in the true scene: " + html_escaped(task->first) + ", %</td>";
    for (const StudyPoint& p : points) html += cell(p.stable_by_task.at(task->first), 100.0);
    html += "</tr>\n";
  }
  for (std::size_t i = 0; i < failure_names().size(); ++i) {
    html += "<tr><td>Failed first: " + failure_titles()[i] + ", %</td>";
    for (const StudyPoint& p : points) html += "<td>" + number(100.0 * p.failures.at(failure_names()[i])) + "</td>";
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string reference_table(const StudySummary& summary) {
  const auto row = [](const std::string& title, const StudyReference& r) {
    return "<tr><td>" + html_escaped(title) + "</td>" + cell(r.stable, 100.0) + cell(r.pct) + cell(r.deg) + "</tr>\n";
  };
  std::string by_task;
  for (const auto& [task, reference] : summary.ground_truth_by_task)
    by_task += row("True scene given to the model: " + task, reference);
  return "<div class=\"scroll\"><table>\n<thead><tr><th>Reference</th><th>stand, %</th><th>displacement, %</th>"
         "<th>displacement, °</th></tr></thead>\n<tbody>" +
         row("True scene given to the model", summary.ground_truth) + by_task +
         row("Random placement", summary.random) + "</tbody></table></div>\n";
}

std::string summary_tables(const StudySummary& summary) {
  if (summary.series.size() == 1) return summary_table(summary.base());
  std::string html;
  for (const StudySeries& series : summary.series) {
    if (series.points.empty()) continue;
    html += "<h3>Series: " + html_escaped(series.title) + "</h3>\n" + summary_table(series.points);
  }
  return html;
}

std::string comparison(const StudySummary& summary) {
  if (summary.series.size() == 1) return "";
  return "<h2>The series side by side</h2>\n<figure>" + series_svg(summary) + "</figure>\n";
}

// Besides the reports' common style: tables that scroll on a narrow screen, and what print needs.
constexpr const char* kStyle = R"(<style>
  figure { margin: 14px 0; overflow-x: auto; } figure svg { width: 100%; min-width: 640px; height: auto; }
  .scroll { overflow-x: auto; }
  td { white-space: nowrap; } td:first-child { white-space: normal; min-width: 13em; } td small { color: var(--soft); }
  thead tr:last-child > * { border-bottom: 2px solid var(--ink); } table { margin: 10px 0 18px; }
  @media print { body { background: none; } main { padding: 0; } h2 { break-after: avoid; }
                 figure, table { break-inside: avoid; } figure svg { min-width: 0; } }
</style>
)";

std::string lead(const StudySummary& summary, const StudyConfig& config) {
  const StudyPoint& first = summary.base().front();
  const StudyPoint& last = summary.base().back();
  const auto clause = [](const StudyPoint& p) {
    const std::string noise = p.noise_scale == 0.0   ? "without noise"
                              : p.noise_scale == 1.0 ? "at the sensor's own noise"
                                                     : "at " + plain(p.noise_scale) + " times the sensor's noise";
    return number(100.0 * p.shares.at("stable_true").value) + " % of the placements stand in the true scene " + noise;
  };
  return "<p class=\"lead\">" + std::to_string(summary.trials) + " trials on " + std::to_string(summary.scenes) +
         " scenes" + (config.series.size() > 1 ? " in " + std::to_string(config.series.size()) + " series" : "") +
         ". The first series: " + series_title(config, 0) + ". " + clause(first) +
         (summary.base().size() > 1 ? "; " + clause(last) : "") + ".</p>\n";
}

std::string method(const StudyConfig& config, std::uint64_t seed) {
  return "<p>Every trial runs the whole chain, as <code>dofusion-place</code> does. A stable scene is generated (in "
         "turn: " +
         tasks_text(config) +
         "), scanned from random viewpoints 30° to 60° above the table, and recovered from those depth images: table, "
         "segmentation, and which of the seven blocks stand where or, of unknown objects, their shapes. For one more "
         "block the model draws " +
         std::to_string(config.samples) + " poses in " + std::to_string(config.steps) +
         " steps; they are settled in the recovered scene, and the one is taken that stands most probably in what the "
         "scene may really be. Its pose relative to where the robot believes its camera to be is then put into the "
         "<em>true</em> scene and settled there. Trials of one scene share viewing directions, query and all seeds; "
         "within a series they differ in the noise alone. Seed " +
         std::to_string(seed) +
         ".</p>\n"
         "<p>A displacement is the largest over all objects, context and query: translation in per cent of that "
         "object's diameter, and rotation. A placement stands if the scene comes to rest with both under 10 % and 10°. "
         "A trial without a displacement (no table was found, or the simulation diverged) counts as larger than any. A "
         "candidate that stands is replaced by the pose at which it came to rest, so that in the scene it was made "
         "for, "
         "the recovered one, next to nothing is left to move. A placement can stand in the true scene although the "
         "recovery was wrong: beside what was missed. What failed first is told of trials whose placement does not "
         "stand in the true scene: no table; a wrong number of objects; a known object taken for another; an object "
         "off "
         "by more than " +
         plain(kPoseErrorPct) +
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

std::string study_html(const StudySummary& summary, const StudyConfig& config, std::uint64_t seed) {
  const std::string title = "What sensor noise costs a placement";
  return html_begin(title) + kStyle + "<h1>" + title + "</h1>\n" + lead(summary, config) +
         "<h2>Displacement against noise</h2>\n<figure>" + displacement_svg(summary, config) + "</figure>\n" +
         "<h2>Success, and what fails</h2>\n<figure>" + success_svg(summary, config) + "</figure>\n" +
         "<p>The worst of them, in pictures: <a href=\"worst.html\">worst.html</a>.</p>\n" + comparison(summary) +
         "<h2>In numbers</h2>\n<p>Shares, and medians with their 95 % intervals.</p>\n" + summary_tables(summary) +
         reference_table(summary) + "<h2>What was done</h2>\n" + method(config, seed) + html_end();
}

void write_study(const std::string& directory, const std::vector<StudyRow>& rows, const StudySummary& summary,
                 const StudyConfig& config, const std::string& settings, std::uint64_t seed) {
  write_file(directory + "/trials.csv", trials_csv(rows));
  write_file(directory + "/summary.json", to_json(summary, settings).dump(2) + "\n");
  write_file(directory + "/displacement.svg", displacement_svg(summary, config));
  write_file(directory + "/success.svg", success_svg(summary, config));
  if (summary.series.size() > 1) write_file(directory + "/series.svg", series_svg(summary));
  write_file(directory + "/report.html", study_html(summary, config, seed));
}

std::string study_text(const StudySummary& summary) {
  std::string out;
  char line[200];
  std::snprintf(line, sizeof line, "%-12s %7s %16s %16s %22s\n", "noise scale", "trials", "true disp. (%)",
                "true disp. (deg)", "stand, recovered/true");
  out += line;
  const auto add = [&](const std::string& name, int trials, const Estimate& pct, const Estimate& deg,
                       const std::string& stand) {
    std::snprintf(line, sizeof line, "%-12s %7d %16s %16s %22s\n", name.c_str(), trials, number(pct.value).c_str(),
                  number(deg.value).c_str(), stand.c_str());
    out += line;
  };
  for (const StudySeries& series : summary.series) {
    if (summary.series.size() > 1) out += series.title + "\n";
    for (const StudyPoint& p : series.points) {
      add(plain(p.noise_scale), p.trials, p.medians.at("displacement_true_pct"), p.medians.at("displacement_true_deg"),
          number(100.0 * p.shares.at("stable_recovered").value) + " / " +
              number(100.0 * p.shares.at("stable_true").value) + " %");
    }
  }
  const auto reference = [&](const char* name, const StudyReference& r) {
    add(name, summary.scenes, r.pct, r.deg, number(100.0 * r.stable.value) + " %");
  };
  reference("true scene", summary.ground_truth);
  reference("random", summary.random);
  return out;
}

}  // namespace dofusion
