#include "apps/study_cases.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <set>

#include <Eigen/Geometry>

#include "apps/html.h"
#include "apps/study_figures.h"
#include "apps/study_runner.h"
#include "perception/picture.h"
#include "stability/parallel_for.h"

namespace dofusion {
namespace {

constexpr int kPictureWidth = 360;  // pixels

double distance_from_own_noise(const StudyRow& row) {
  return row.noise_scale > 0.0 ? std::abs(std::log(row.noise_scale)) : std::numeric_limits<double>::max();
}

// What was not carried out, or diverged, shows little.
double moved(const StudyRow& row) { return row.displacement_true_pct.value_or(-1.0); }

Scene with_query(const Scene& context, const ObjectPtr& query, const std::vector<Pose>& context_poses,
                 const Pose& T_world_query) {
  Scene scene{context.objects, context_poses};
  scene.objects.push_back(query);
  scene.T_world_object.push_back(T_world_query);
  return scene;
}

struct CasePictures {
  std::string depth, segmentation, recovered, put, settled;  // JPEG
};

// The part of the camera's image that the narrower camera sees, and the camera of that part.
template <typename Pixel>
Image<Pixel> cropped(const Image<Pixel>& image, const Eigen::AlignedBox2i& part) {
  Image<Pixel> result(part.sizes().x(), part.sizes().y());
  for (int v = 0; v < result.height; ++v)
    for (int u = 0; u < result.width; ++u) result.at(v, u) = image.at(part.min().y() + v, part.min().x() + u);
  return result;
}

Eigen::AlignedBox2i part_seen_by(const Camera& close, const Camera& whole) {
  const auto pixel = [&](double u, double v) {
    return Eigen::Vector2d((u - close.cx) / close.fx * whole.fx + whole.cx,
                           (v - close.cy) / close.fy * whole.fy + whole.cy);
  };
  const Eigen::Array2i size(whole.width, whole.height);
  const Eigen::Array2i low = pixel(0, 0).array().cast<int>().max(0).min(size - 2);
  const Eigen::Array2i high = pixel(close.width, close.height).array().cast<int>().max(low + 2).min(size);
  return {low.matrix(), high.matrix()};
}

CasePictures render(const StudyScene& scene, const StudyTrial& trial) {
  CasePictures pictures;
  const SyntheticView& view = trial.views.front();
  const Camera camera = default_camera();
  if (!trial.best) {
    pictures.depth = to_jpeg(depth_picture(view.depth));
    return pictures;
  }
  const Pose& T_recovered_camera = trial.recovered.table->T_world_camera;
  const Scene& found = trial.recovered.scene;
  const Pose T_true_query = trial.T_true_recovered * trial.best->T_world_query;
  const Scene recovered = with_query(found, scene.query, found.T_world_object, trial.best->T_world_query);
  const Scene put = with_query(scene.truth, scene.query, scene.truth.T_world_object, T_true_query);
  Scene settled = put;
  if (trial.settled_true.size() == put.objects.size()) settled.T_world_object = trial.settled_true;
  const Camera close = zoomed_on(camera, view.T_world_camera, {put, settled}, kPictureWidth);

  const Eigen::AlignedBox2i part = part_seen_by(close, camera);
  const DepthImage depth = cropped(view.depth, part);
  Camera of_part = camera;
  of_part.cx -= part.min().x();
  of_part.cy -= part.min().y();
  of_part.width = depth.width;
  of_part.height = depth.height;
  pictures.depth = to_jpeg(depth_picture(depth));
  pictures.segmentation = to_jpeg(segmentation_picture(cropped(trial.recovered.labels, part), depth, of_part));

  const auto picture = [&](const Scene& what, const Pose& T_world_camera) {
    PictureOptions options;
    options.highlighted = static_cast<int>(what.objects.size()) - 1;
    return to_jpeg(shaded_picture(what, close, T_world_camera, options));
  };
  pictures.recovered = picture(recovered, T_recovered_camera);
  pictures.put = picture(put, view.T_world_camera);
  pictures.settled = picture(settled, view.T_world_camera);
  return pictures;
}

std::string figure(const std::string& picture, const std::string& caption) {
  if (picture.empty()) return "";
  return "<figure>" + embedded_image(picture, caption) + "<figcaption>" + html_escaped(caption) +
         "</figcaption></figure>\n";
}

std::string rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, value < 10.0 ? "%.1f" : "%.0f", value);
  return text;
}

// "trial 7: unknown objects, noise scale 1; cube, hat on the table, the arch to place. 3 objects found of 2; …"
std::string description(const StudyConfig& config, const StudyRow& row) {
  std::string context;
  for (const char c : row.context) context += c == '+' ? std::string(", ") : std::string(1, c);
  std::string text = "Trial " + std::to_string(row.trial) + ": " +
                     series_title(config, static_cast<std::size_t>(row.series)) + "; noise scale " +
                     plain(row.noise_scale) + "; on the table: " + context + "; to place: " + row.query +
                     (row.on_top ? ", on top" : "") + ". ";
  if (!row.objects_found) return text + "No table was found.";
  text += std::to_string(*row.objects_found) + " objects found of " + std::to_string(row.objects_true);
  if (row.shapes_right) text += ", " + std::to_string(*row.shapes_right) + " of the right shape";
  if (row.position_error_max_mm) text += ", the worst off by " + rounded(*row.position_error_max_mm) + " mm";
  if (!row.stable_recovered) return text + ". No candidate was as wished.";
  text += ". In the recovered scene the placement " +
          std::string(row.stable_recovered.value_or(false) ? "stands; " : "falls; ");
  if (!row.displacement_true_pct) return text + "in the true one the simulation diverged.";
  return text + "in the true one things move by " + rounded(*row.displacement_true_pct) + " % and " +
         rounded(row.displacement_true_deg.value_or(0.0)) + "°.";
}

std::string case_html(const StudyConfig& config, const StudyRow& row, const CasePictures& pictures) {
  return "<p>" + html_escaped(description(config, row)) + "</p>\n<div class=\"case\">\n" +
         figure(pictures.depth, "Depth as read") + figure(pictures.segmentation, "Segmentation") +
         figure(pictures.recovered, "Recovered, with the placement") +
         figure(pictures.put, "The true scene, placed so") + figure(pictures.settled, "… and at rest") + "</div>\n";
}

std::string heading(const std::string& failure) {
  const std::vector<std::string>& names = failure_names();
  const auto kind = std::find(names.begin(), names.end(), failure);
  if (kind == names.end()) return "Stands";
  return "Failed first: " + failure_titles()[static_cast<std::size_t>(kind - names.begin())];
}

constexpr const char* kStyle = R"(<style>
  main { max-width: 1400px; }
  .case { display: grid; gap: 10px; grid-template-columns: repeat(5, 1fr); margin-bottom: 26px; }
  .case img { aspect-ratio: 4 / 3; object-fit: cover; }
  @media (max-width: 900px) { .case { grid-template-columns: repeat(2, 1fr); } }
  @media print { main { padding: 0; } .case { break-inside: avoid; } }
</style>
)";

}  // namespace

std::vector<StudyRow> worst_cases(const std::vector<StudyRow>& rows, int each) {
  std::vector<StudyRow> sorted = rows;
  std::stable_sort(sorted.begin(), sorted.end(), [](const StudyRow& a, const StudyRow& b) {
    const double near_a = distance_from_own_noise(a), near_b = distance_from_own_noise(b);
    return near_a != near_b ? near_a < near_b : moved(a) > moved(b);
  });
  std::vector<StudyRow> cases;
  for (const std::string& failure : failure_names()) {
    std::set<std::int64_t> scenes;
    for (const StudyRow& row : sorted) {
      if (static_cast<int>(scenes.size()) == each) break;
      if (row.failure == failure && scenes.insert(row.scene).second) cases.push_back(row);
    }
  }
  return cases;
}

std::string cases_html(const StudyJob& job, const std::vector<StudyRow>& cases) {
  const StudyModels models(job.config);
  const std::vector<ObjectPtr> library = load_block_library();
  std::vector<std::unique_ptr<StudyRunner>> runners;
  for (int t = 0; t < job.threads; ++t)
    runners.push_back(std::make_unique<StudyRunner>(job.config, job.seed, models, library));
  std::vector<std::string> parts(cases.size());
  parallel_for(static_cast<std::int64_t>(cases.size()), job.threads, [&](std::int64_t i, int thread) {
    StudyRunner& runner = *runners[static_cast<std::size_t>(thread)];
    const StudyRow& row = cases[static_cast<std::size_t>(i)];
    const StudyScene scene = runner.make_scene(row.scene);
    const StudyTrial trial = runner.run(scene, row.trial, row);
    parts[static_cast<std::size_t>(i)] = case_html(job.config, row, render(scene, trial));
  });

  const std::string title = "Where placements fall";
  std::string html = html_begin(title) + kStyle + "<h1>" + title +
                     "</h1>\n<p class=\"soft\">Of every kind of failure "
                     "the trials nearest to the sensor's own noise in which most moved, each of another scene. The "
                     "block to place is orange.</p>\n";
  if (cases.empty()) html += "<p>Every placement stands.</p>\n";
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (i == 0 || cases[i].failure != cases[i - 1].failure) {
      html += "<h2>" + html_escaped(heading(cases[i].failure)) + "</h2>\n";
    }
    html += parts[i];
  }
  return html + html_end();
}

}  // namespace dofusion
