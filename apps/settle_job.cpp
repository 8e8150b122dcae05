#include "apps/settle_job.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "apps/program.h"
#include "stability/dataset.h"
#include "stability/files.h"
#include "stability/mjcf.h"
#include "stability/mjcf_scene.h"
#include "stability/robustness.h"

namespace dofusion {
namespace {

using nlohmann::ordered_json;

const char* const kSurroundings = "surroundings";

// What either kind of input comes down to.
struct Settled {
  std::vector<std::string> names;
  std::vector<double> diameters;
  std::vector<Pose> before;
  SettleResult result;
};

SettleResult only(const SettleResult& all, std::size_t i) {
  SettleResult one = all;
  one.T_world_object = {all.T_world_object[i]};
  one.turned = {all.turned[i]};
  return one;
}

std::vector<std::string> touched_by(int body, const Settled& settled) {
  std::vector<std::string> names;
  for (const auto& [a, b] : settled.result.touching) {
    if (a != body && b != body) continue;
    const int other = a == body ? b : a;
    names.push_back(other < 0 ? kSurroundings : settled.names[static_cast<std::size_t>(other)]);
  }
  return names;
}

SettleReport report_of(const std::string& source, const Settled& settled) {
  SettleReport report;
  report.source = source;
  report.outcome = judge(settled.diameters, settled.before, settled.result);
  report.seconds = settled.result.seconds;
  for (std::size_t i = 0; i < settled.names.size(); ++i) {
    SettledBody body;
    body.name = settled.names[i];
    body.diameter = settled.diameters[i];
    body.outcome = judge({settled.diameters[i]}, {settled.before[i]}, only(settled.result, i));
    body.T_world_body = settled.result.T_world_object[i];
    body.touches = touched_by(static_cast<int>(i), settled);
    report.bodies.push_back(std::move(body));
  }
  return report;
}

std::size_t find_query(const std::vector<std::string>& names, const std::string& query) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == query) found.push_back(i);
  }
  if (found.size() == 1) return found.front();
  if (found.size() > 1) {
    throw InputError("--query: several bodies are called '" + query + "'; give an index, the first is " +
                     std::to_string(found.front()));
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (query == std::to_string(i)) return i;
  }
  std::string known;
  for (const std::string& name : names) known += (known.empty() ? "" : ", ") + name;
  throw InputError("--query: no body '" + query + "' moves; those that do: " + (known.empty() ? "none" : known));
}

QueryReport ask(const Scene& settled, std::size_t query) {
  const Simulator simulator(settled.objects);
  const int object = static_cast<int>(query);
  return {settled.objects[query]->name, largest_push(simulator, settled.T_world_object, object),
          comes_off_upside_down(simulator, settled.T_world_object, object)};
}

void finish(const SettleJob& job, const Scene& settled, std::optional<std::size_t> query, SettleReport& report) {
  if (query && report.outcome.status != SettleStatus::kDiverged) report.query = ask(settled, *query);
  if (!job.out.empty()) write_mjcf(settled, job.out);
}

SettleReport settle_mjcf(const SettleJob& job) {
  const MjcfScene file(job.mjcf, job.keyframe);
  Settled settled;
  const std::vector<Pose> poses = file.initial_poses();
  for (const int index : file.moving()) {
    const SceneBody& body = file.bodies()[static_cast<std::size_t>(index)];
    settled.names.push_back(body.name);
    settled.diameters.push_back(body.diameter);
    settled.before.push_back(poses[static_cast<std::size_t>(index)]);
  }
  std::optional<std::size_t> query;
  const bool as_objects = !job.query.empty() || !job.out.empty();
  if (as_objects) {  // before long work
    std::vector<std::string> objects;
    for (const ObjectPtr& object : file.to_scene().objects) objects.push_back(object->name);
    if (!job.query.empty()) query = find_query(objects, job.query);
  }
  PhysicsOptions options;
  options.time_limit = job.time_limit;
  settled.result = file.settle(options, interrupted);
  if (interrupted()) throw Interrupted("interrupted");
  SettleReport report = report_of(job.mjcf, settled);
  if (as_objects) finish(job, file.to_scene(settled.result.T_world_object), query, report);
  return report;
}

SettleReport settle_dataset_scene(const SettleJob& job) {
  DatasetFilter filter;
  filter.most = static_cast<std::size_t>(job.scene) + 1;
  const SceneDataset dataset = read_dataset(job.data, filter);
  if (static_cast<std::int64_t>(dataset.scenes.size()) <= job.scene) {
    throw InputError(job.data + ": has no scene " + std::to_string(job.scene) + ", only " +
                     std::to_string(dataset.scenes.size()));
  }
  Scene scene = to_scene(dataset, dataset.scenes.back());
  Settled settled;
  for (const ObjectPtr& object : scene.objects) settled.names.push_back(object->name);
  settled.diameters = diameters_of(scene.objects);
  settled.before = scene.T_world_object;
  std::optional<std::size_t> query;
  if (!job.query.empty()) query = find_query(settled.names, job.query);
  PhysicsOptions options;
  options.time_limit = job.time_limit;
  settled.result = Simulator(scene.objects, options).settle(scene.T_world_object);
  SettleReport report = report_of(job.data + ", scene " + std::to_string(job.scene), settled);
  scene.T_world_object = settled.result.T_world_object;
  finish(job, scene, query, report);
  return report;
}

template <class... Values>
std::string formatted(const char* format, Values... values) {
  std::string text(static_cast<std::size_t>(std::snprintf(nullptr, 0, format, values...)), '\0');
  std::snprintf(text.data(), text.size() + 1, format, values...);
  return text;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "nothing" : text;
}

const char* yes(bool value) { return value ? "yes" : "no"; }

std::string figures(const Outcome& o) {
  return formatted("%10.3f %10.3f %10.3f %10.3f", o.displacement.translation_pct, o.displacement.rotation_deg,
                   o.accumulated_rotation_deg, o.tilt_deg);
}

// JSON has no infinity.
ordered_json number(double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(); }

void add_figures(const Outcome& o, ordered_json& to) {
  to["translational_displacement_pct"] = number(o.displacement.translation_pct);
  to["rotational_displacement_deg"] = number(o.displacement.rotation_deg);
  to["accumulated_rotation_deg"] = number(o.accumulated_rotation_deg);
  to["tilt_deg"] = number(o.tilt_deg);
}

ordered_json rows(const Pose& pose) {
  ordered_json matrix = ordered_json::array();
  for (int i = 0; i < 4; ++i) {
    matrix.push_back({pose.matrix()(i, 0), pose.matrix()(i, 1), pose.matrix()(i, 2), pose.matrix()(i, 3)});
  }
  return matrix;
}

}  // namespace

SettleReport settle_scene(const SettleJob& job) {
  return job.mjcf.empty() ? settle_dataset_scene(job) : settle_mjcf(job);
}

std::string to_text(const SettleReport& report) {
  std::size_t width = 5;
  for (const SettledBody& body : report.bodies) width = std::max(width, body.name.size());
  const int w = static_cast<int>(width);
  const Outcome& o = report.outcome;
  std::string text = formatted("%s: %zu bodies move; %s after %.2f s\n\n", report.source.c_str(), report.bodies.size(),
                               to_string(o.status).c_str(), report.seconds);
  text +=
      formatted("%-*s %10s %10s %10s %10s  touches\n", w, "body", "moved/%", "turned/deg", "in all/deg", "tilt/deg");
  for (const SettledBody& body : report.bodies) {
    text += formatted("%-*s ", w, body.name.c_str()) + figures(body.outcome) + "  " + joined(body.touches) + "\n";
  }
  text += formatted("%-*s ", w, "most") + figures(o) + "\n\n";
  text += formatted("stable: %s   quiet: %s   tilted: %s   initial penetration: %.3f mm\n", yes(o.stable), yes(o.quiet),
                    yes(o.tilted), 1000.0 * o.initial_penetration);
  if (report.query) {
    text += formatted("%s withstands a push of %.2f weights; comes off upside down: %s\n", report.query->name.c_str(),
                      report.query->largest_push, yes(report.query->comes_off));
  }
  return text;
}

ordered_json to_json(const SettleReport& report) {
  const Outcome& o = report.outcome;
  ordered_json json{{"format", "dofusion-settle"}, {"version", 1}, {"source", report.source}};
  json["status"] = to_string(o.status);
  json["seconds"] = report.seconds;
  json["stable"] = o.stable;
  json["quiet"] = o.quiet;
  json["tilted"] = o.tilted;
  json["initial_penetration_m"] = o.initial_penetration;
  add_figures(o, json);
  json["bodies"] = ordered_json::array();
  for (const SettledBody& body : report.bodies) {
    ordered_json entry{{"name", body.name}, {"diameter_m", body.diameter}};
    add_figures(body.outcome, entry);
    entry["T_world_body"] = rows(body.T_world_body);
    entry["touches"] = body.touches;
    json["bodies"].push_back(std::move(entry));
  }
  if (report.query) {
    json["query"] = {{"name", report.query->name},
                     {"largest_push_weights", report.query->largest_push},
                     {"comes_off_upside_down", report.query->comes_off}};
  }
  return json;
}

}  // namespace dofusion
