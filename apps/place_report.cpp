#include "apps/place_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "apps/html.h"
#include "apps/program.h"
#include "apps/viewer/viewer_script.h"
#include "perception/picture.h"
#include "stability/parallel_for.h"

namespace dofusion {
namespace {

constexpr std::size_t kShownPlacements = 3;
constexpr int kPictureWidth = 480;  // pixels; enough for a report, quick to render

std::string number(double value, int digits = 2) {
  if (!std::isfinite(value)) return "–";
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string figure(const std::string& png, const std::string& caption) {
  return "<figure>" + embedded_image(png, caption) + "<figcaption>" + html_escaped(caption) + "</figcaption></figure>\n";
}

Scene with_query(const Scene& context, const ObjectPtr& query, const std::vector<Pose>& poses) {
  Scene scene{context.objects, poses};
  scene.objects.push_back(query);
  return scene;
}

std::vector<Pose> generated_poses(const Scene& context, const Placement& placement) {
  std::vector<Pose> poses = context.T_world_object;
  poses.push_back(placement.T_world_sampled);
  return poses;
}

// The depth camera zoomed to the objects and the best placements.
Camera zoomed_camera(const PlaceInputs& inputs, const PlaceResult& result, std::size_t shown) {
  const Scene& context = result.recovered.scene;
  std::vector<Scene> scenes = {context};
  for (std::size_t k = 0; k < shown; ++k) {
    scenes.push_back({{inputs.query}, {result.placements[k].T_world_sampled}});
    scenes.push_back({{inputs.query}, {result.placements[k].settled.back()}});
  }
  return zoomed_on(inputs.camera, result.recovered.table->T_world_camera, scenes, kPictureWidth);
}

std::string verdict(const Placement& placement) {
  if (placement.stable) return "<span class=\"good\">stable</span>";
  switch (placement.status) {
    case SettleStatus::kSettled: return "<span class=\"bad\">moves</span>";
    case SettleStatus::kTimeLimit: return "<span class=\"bad\">does not come to rest</span>";
    case SettleStatus::kDiverged: return "<span class=\"bad\">simulation diverged</span>";
  }
  return "";
}

std::string objects_table(const RecoveredScene& recovered) {
  std::string html = "<table><tr><th>#</th><th class=\"text\">object</th><th>x, y, z (mm)</th><th>size (mm)</th>"
                     "<th class=\"wide\">pixels</th><th>explained</th></tr>\n";
  for (std::size_t i = 0; i < recovered.objects.size(); ++i) {
    const RecoveredObject& object = recovered.objects[i];
    const Eigen::Vector3d at = object.T_world_object.translation() * 1000.0;
    const BoundingBox box = bounding_box(object.object->mesh);
    const Eigen::Vector3d size = (box.max - box.min) * 1000.0;
    html += "<tr><td>" + std::to_string(i) + "</td><td class=\"text\">" + html_escaped(object.name) + "</td><td>" +
            number(at.x(), 0) + ", " + number(at.y(), 0) + ", " + number(at.z(), 0) + "</td><td>" + number(size.x(), 0) +
            " × " + number(size.y(), 0) + " × " + number(size.z(), 0) + "</td><td class=\"wide\">" + std::to_string(object.pixels) +
            "</td><td>" + number(100.0 * object.score, 0) + " %</td></tr>\n";
  }
  return html + "</table>\n";
}

std::string placements_table(const PlaceResult& result) {
  std::string html = "<table id=\"candidates\"><tr><th>rank</th><th class=\"text\">verdict</th><th>moves by (% of diameter)</th>"
                     "<th>turns by (degrees)</th><th>overlap before (mm)</th><th>stands when disturbed</th>"
                     "<th class=\"wide\">x, y, z (mm)</th></tr>\n";
  for (std::size_t i = 0; i < result.placements.size(); ++i) {
    const Placement& p = result.placements[i];
    const Eigen::Vector3d at = p.T_world_query.translation() * 1000.0;
    html += "<tr data-row><td>" + std::to_string(i + 1) + "</td><td class=\"text\">" + verdict(p) + "</td><td>" +
            number(p.displacement.translation_pct) + "</td><td>" + number(p.displacement.rotation_deg) + "</td><td>" +
            number(p.penetration * 1000.0) + "</td><td>" + (p.robustness ? number(100.0 * *p.robustness, 0) + " %" : "–") +
            "</td><td class=\"wide\">" + number(at.x(), 0) + ", " + number(at.y(), 0) + ", " + number(at.z(), 0) + "</td></tr>\n";
  }
  return html + "</table>\n";
}

// What viewer.js makes an interactive view of: a place for it with a line that is true until then, the list, the still
// pictures, the scene and the script itself.
std::string candidates_section(const PlaceResult& result, const ReportPictures& pictures, const std::string& glb) {
  const bool interactive = !viewer_script().empty();
  std::string html = "<h2>The candidates</h2>\n<p class=\"soft\">Each was settled with the whole scene. Displacements are "
                     "the largest over all objects; stable means that everything comes to rest and nothing moves more than "
                     "10 % of its diameter or 10 degrees.</p>\n<div class=\"candidates\">\n<div id=\"viewer\"><p class=\"soft "
                     "note\">";
  html += interactive ? "The interactive view needs JavaScript and WebGL; without them there are the still pictures."
                      : "This toolkit was built without the interactive view; scene.glb opens in any glTF viewer.";
  html += "</p></div>\n<div class=\"list\">\n" + placements_table(result) + "</div>\n</div>\n" +
          "<details id=\"stills\" open><summary>The best, as generated and as they settle</summary>\n<div class=\"pairs\">\n";
  for (const auto& best : pictures.best) {
    const Placement& p = result.placements[best.rank - 1];
    html += figure(best.before, "Rank " + std::to_string(best.rank) + " as the model generates it") +
            figure(best.after, "Rank " + std::to_string(best.rank) + " settled; placed there, things move by " +
                                   number(p.displacement.translation_pct) + " % and " +
                                   number(p.displacement.rotation_deg) + "°");
  }
  html += "</div></details>\n";
  if (interactive) {
    html += "<script type=\"text/plain\" id=\"scene-glb\">" + base64(glb) + "</script>\n<script>" +
            std::string(viewer_script()) + "</script>\n";
  }
  return html;
}

std::string timing_line(const PlaceResult& result) {
  std::string text;
  for (const auto& [step, ms] : result.timing_ms) {
    text += (text.empty() ? "" : ", ") + step + " " + number(ms / 1000.0) + " s";
  }
  return text;
}

}  // namespace

ReportPictures render_pictures(const PlaceInputs& inputs, const PlaceResult& result, int threads) {
  ReportPictures pictures;
  pictures.depth = to_png(depth_picture(inputs.depth));
  if (!result.recovered.table) return pictures;
  pictures.segmentation = to_png(segmentation_picture(result.recovered.labels, inputs.depth, inputs.camera));

  // Picture 0 is the recovered scene; then before and after of each of the best.
  const std::size_t shown = std::min(kShownPlacements, result.placements.size());
  const Scene& context = result.recovered.scene;
  const Camera whole = resized(inputs.camera, std::min(1.0, static_cast<double>(kPictureWidth) / inputs.camera.width));
  const Camera close = zoomed_camera(inputs, result, shown);
  const Pose& T_world_camera = result.recovered.table->T_world_camera;
  std::vector<std::string> rendered(1 + 2 * shown);
  parallel_for(static_cast<std::int64_t>(rendered.size()), threads, [&](std::int64_t i, int) {
    PictureOptions options;
    Scene scene = context;
    if (i > 0) {
      const Placement& placement = result.placements[static_cast<std::size_t>((i - 1) / 2)];
      const bool before = i % 2 == 1;
      scene = with_query(context, inputs.query, before ? generated_poses(context, placement) : placement.settled);
      options.highlighted = static_cast<int>(context.objects.size());
    }
    rendered[static_cast<std::size_t>(i)] = to_png(shaded_picture(scene, i == 0 ? whole : close, T_world_camera, options));
  });
  pictures.recovered = rendered[0];
  for (std::size_t k = 0; k < shown; ++k) pictures.best.push_back({k + 1, rendered[1 + 2 * k], rendered[2 + 2 * k]});
  return pictures;
}

std::string report_html(const PlaceInputs& inputs, const PlaceArguments& arguments, const PlaceResult& result,
                        const ReportPictures& pictures, const std::string& glb) {
  std::string html = html_begin("Placements of the " + inputs.query->name);
  html += "<h1>Where can the " + html_escaped(inputs.query->name) + " go?</h1>\n<p class=\"lead\">" +
          html_escaped(summary_line(inputs, result)) + ".</p>\n";
  html += "<p class=\"soft\">" + html_escaped(inputs.source) + " · objects " +
          (arguments.objects.empty() ? "unknown" : "among the meshes of " + html_escaped(arguments.objects)) + " · seed " +
          std::to_string(arguments.placement.seed) + "</p>\n";

  html += "<h2>What was seen, and what was recovered</h2>\n<div class=\"row\">\n" +
          figure(pictures.depth, "Depth: near is warm, far is cold, black has no reading");
  if (result.recovered.table) {
    html += figure(pictures.segmentation, "Segmentation: the table and the objects") +
            figure(pictures.recovered, "The recovered scene from the same camera");
  }
  html += "</div>\n";
  if (!result.recovered.objects.empty()) {
    html += objects_table(result.recovered) + "<p class=\"soft\">To come to rest, the recovered objects moved by at most " +
            number(result.recovered.moved_pct) + " % of their diameter and " + number(result.recovered.moved_deg) +
            " degrees (" + to_string(result.recovered.settled) + ").</p>\n";
  }
  if (!result.placements.empty()) html += candidates_section(result, pictures, glb);
  html += "<p class=\"soft\">Time: " + timing_line(result) + ".</p>\n";
  return html + html_end();
}

}  // namespace dofusion
