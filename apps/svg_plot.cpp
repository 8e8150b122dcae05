#include "apps/svg_plot.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "apps/html.h"

namespace dofusion {
namespace {

constexpr double kWidth = 960.0, kLegendRow = 22.0, kTop = 12.0, kTitle = 26.0, kPlotHeight = 300.0;
constexpr double kLeftMargin = 80.0, kRightMargin = 14.0, kBottomMargin = 64.0, kCaptionRow = 18.0;
constexpr double kAside = 8.0;  // between the curves of a panel
constexpr const char* kInk = "#222222";
constexpr const char* kGrid = "#dddddd";

__attribute__((format(printf, 1, 2))) std::string format(const char* pattern, ...) {
  char buffer[1024];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(buffer, sizeof buffer, pattern, arguments);
  va_end(arguments);
  return buffer;
}

std::string text(double x, double y, const std::string& words, const char* anchor = "start", const char* extra = "") {
  return format("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" %s>", x, y, anchor, extra) + html_escaped(words) +
         "</text>\n";
}

std::string line(double x1, double y1, double x2, double y2, const std::string& style) {
  return format("<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" ", x1, y1, x2, y2) + style + "/>\n";
}

std::string stroke(const std::string& colour, double width, const std::string& dashes = "") {
  return "stroke=\"" + colour + format("\" stroke-width=\"%.1f\"", width) +
         (dashes.empty() ? "" : " stroke-dasharray=\"" + dashes + "\"");
}

std::string marker(Marker shape, double x, double y, const std::string& colour) {
  const std::string fill = "fill=\"" + colour + "\" stroke=\"white\" stroke-width=\"1\"/>\n";
  switch (shape) {
    case Marker::kCircle:
      return format("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"5\" ", x, y) + fill;
    case Marker::kSquare:
      return format("<rect x=\"%.1f\" y=\"%.1f\" width=\"9\" height=\"9\" ", x - 4.5, y - 4.5) + fill;
    case Marker::kDiamond:
      return format("<path d=\"M%.1f %.1fl6 6l-6 6l-6 -6z\" ", x, y - 6.0) + fill;
  }
  return "";
}

// A panel's place on the page and the way from values to it.
struct Frame {
  const PlotPanel& panel;
  double left, top, right, bottom;

  static double along(const PlotAxis& axis, double value) {
    const double v = std::clamp(std::max(value, axis.floor), axis.low, axis.high);
    return axis.logarithmic ? std::log(v / axis.low) / std::log(axis.high / axis.low)
                            : (v - axis.low) / (axis.high - axis.low);
  }
  double x(double value) const { return left + (right - left) * along(panel.x, value); }
  double y(double value) const { return bottom - (bottom - top) * along(panel.y, value); }
};

std::string draw_axes(const Frame& f) {
  std::string svg;
  for (const PlotTick& tick : f.panel.y.ticks) {
    const double y = f.y(tick.at);
    svg += line(f.left, y, f.right, y, stroke(kGrid, 1.0));
    svg += text(f.left - 8.0, y + 4.5, tick.label, "end");
  }
  for (const PlotTick& tick : f.panel.x.ticks) {
    const double x = f.x(tick.at);
    svg += line(x, f.bottom, x, f.bottom + 5.0, stroke(kInk, 1.0));
    svg += text(x, f.bottom + 19.0, tick.label, "middle");
    if (!tick.below.empty()) svg += text(x, f.bottom + 35.0, tick.below, "middle", "class=\"soft\"");
  }
  svg += line(f.left, f.bottom, f.right, f.bottom, stroke(kInk, 1.2));
  svg += line(f.left, f.top, f.left, f.bottom, stroke(kInk, 1.2));
  svg += text((f.left + f.right) / 2.0, f.bottom + 55.0, f.panel.x.title, "middle");
  const double x = f.left - 65.0, y = (f.top + f.bottom) / 2.0;
  svg += text(x, y, f.panel.y.title, "middle", format("transform=\"rotate(-90 %.1f %.1f)\"", x, y).c_str());
  svg += text(f.left, f.top - 10.0, f.panel.title, "start", "class=\"title\"");
  return svg;
}

std::string draw_reference(const Frame& f, const PlotReference& reference) {
  if (!std::isfinite(reference.y)) return "";
  const double high = std::isfinite(reference.high) ? f.y(reference.high) : f.top;
  const double low = std::isfinite(reference.low) ? f.y(reference.low) : f.bottom;
  return format("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\" opacity=\"0.11\"/>\n", f.left,
                high, f.right - f.left, std::max(0.0, low - high), reference.colour.c_str()) +
         line(f.left, f.y(reference.y), f.right, f.y(reference.y), stroke(reference.colour, 2.0, reference.dashes));
}

std::string draw_limit(const Frame& f, const PlotLimit& limit) {
  const double y = f.y(limit.y);
  return line(f.left, y, f.right, y, stroke("#777777", 1.0, "2 3")) +
         text(f.right - 4.0, y - 5.0, limit.label, "end", "class=\"soft\"");
}

// Runs of finite points.
std::vector<std::vector<PlotPoint>> unbroken(const std::vector<PlotPoint>& points) {
  std::vector<std::vector<PlotPoint>> runs(1);
  for (const PlotPoint& p : points) {
    if (std::isfinite(p.y))
      runs.back().push_back(p);
    else if (!runs.back().empty())
      runs.emplace_back();
  }
  return runs;
}

// `aside`: units to the right of where the curve belongs.
std::string draw_band(const Frame& f, const PlotCurve& curve, double aside) {
  std::string svg;
  for (const auto& run : unbroken(curve.points)) {
    if (run.empty()) continue;
    std::string corners;
    for (const PlotPoint& p : run)
      corners += format("%.1f,%.1f ", f.x(p.x) + aside, f.y(std::isnan(p.high) ? p.y : p.high));
    for (auto p = run.rbegin(); p != run.rend(); ++p)
      corners += format("%.1f,%.1f ", f.x(p->x) + aside, f.y(std::isnan(p->low) ? p->y : p->low));
    svg += "<polygon points=\"" + corners + "\" fill=\"" + curve.colour + "\" opacity=\"0.20\"/>\n";
  }
  return svg;
}

std::string draw_curve(const Frame& f, const PlotCurve& curve, double aside) {
  std::string svg;
  for (const auto& run : unbroken(curve.points)) {
    std::string corners, markers;
    for (const PlotPoint& p : run) {
      corners += format("%.1f,%.1f ", f.x(p.x) + aside, f.y(p.y));
      markers += marker(curve.marker, f.x(p.x) + aside, f.y(p.y), curve.colour);
    }
    svg += "<polyline points=\"" + corners + "\" fill=\"none\" " + stroke(curve.colour, 2.4) + "/>\n" + markers;
  }
  return svg;
}

std::string swatch(const PlotPart& part, double x, double y, double width, double height) {
  std::string svg = format(
      "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\" stroke=\"white\" "
      "stroke-width=\"1\"/>\n",
      x, y, width, height, part.colour.c_str());
  if (part.hatched) {
    svg += format("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"url(#hatch)\"/>\n", x, y, width,
                  height);
  }
  return svg;
}

std::string draw_bars(const Frame& f) {
  std::string svg;
  const std::size_t count = f.panel.bars.size();
  const double width = std::min(54.0, 0.6 * (f.right - f.left) / static_cast<double>(std::max<std::size_t>(count, 1)));
  for (const PlotBar& bar : f.panel.bars) {
    double sum = 0.0;
    for (std::size_t i = 0; i < bar.parts.size(); ++i) {
      const double bottom = f.y(sum), top = f.y(sum + bar.parts[i]);
      sum += bar.parts[i];
      if (bottom - top > 0.05) svg += swatch(f.panel.parts[i], f.x(bar.x) - width / 2.0, top, width, bottom - top);
    }
  }
  return svg;
}

std::string draw_panel(const Frame& f) {
  std::string svg = draw_axes(f) + draw_bars(f);
  for (const PlotLimit& limit : f.panel.limits) svg += draw_limit(f, limit);
  for (const PlotReference& reference : f.panel.references) svg += draw_reference(f, reference);
  const auto aside = [&](std::size_t i) {
    return kAside * (static_cast<double>(i) - 0.5 * static_cast<double>(f.panel.curves.size() - 1));
  };
  for (std::size_t i = 0; i < f.panel.curves.size(); ++i) svg += draw_band(f, f.panel.curves[i], aside(i));
  for (std::size_t i = 0; i < f.panel.curves.size(); ++i) svg += draw_curve(f, f.panel.curves[i], aside(i));
  return svg;
}

// Entries from left to right, broken into rows; `height` receives the rows' height.
std::string draw_legend(const std::vector<PlotPanel>& panels, double& height) {
  std::string svg;
  double x = kLeftMargin, y = kTop;
  const auto place = [&](const std::string& name) {
    const double length = 44.0 + 7.0 * static_cast<double>(name.size()) + 18.0;  // 7: a letter's width, about
    if (x > kLeftMargin && x + length > kWidth) {
      x = kLeftMargin;
      y += kLegendRow;
    }
    const double at = x;
    x += length;
    return at;
  };
  for (const PlotCurve& curve : panels.front().curves) {
    const double at = place(curve.name);
    svg += format("<rect x=\"%.1f\" y=\"%.1f\" width=\"34\" height=\"14\" fill=\"%s\" opacity=\"0.20\"/>\n", at, y,
                  curve.colour.c_str());
    svg += line(at, y + 7.0, at + 34.0, y + 7.0, stroke(curve.colour, 2.4));
    svg += marker(curve.marker, at + 17.0, y + 7.0, curve.colour) + text(at + 42.0, y + 11.5, curve.name);
  }
  for (const PlotReference& reference : panels.front().references) {
    const double at = place(reference.name);
    svg += line(at, y + 7.0, at + 34.0, y + 7.0, stroke(reference.colour, 2.0, reference.dashes));
    svg += text(at + 42.0, y + 11.5, reference.name);
  }
  if (!panels.front().curves.empty() && x > kLeftMargin) {
    for (const PlotPanel& panel : panels) {
      if (panel.parts.empty()) continue;
      x = kLeftMargin;  // the bars' parts begin a row of their own
      y += kLegendRow;
      break;
    }
  }
  for (const PlotPanel& panel : panels) {
    for (const PlotPart& part : panel.parts) {
      const double at = place(part.name);
      svg += swatch(part, at, y, 34.0, 14.0) + text(at + 42.0, y + 11.5, part.name);
    }
  }
  height = y + kLegendRow;
  return svg;
}

}  // namespace

PlotAxis log_axis(const std::string& title, double low, double high) {
  PlotAxis axis{title, 0.6 * low, high, true, {}, low};
  for (double at = low; at < high * 1.001; at *= 10.0) {
    axis.ticks.push_back({at, (axis.ticks.empty() ? "≤" : "") + format("%g", at), ""});
  }
  return axis;
}

std::string draw_figure(const std::vector<PlotPanel>& panels, const std::vector<std::string>& caption) {
  double legend_height = 0.0;
  const std::string legend = draw_legend(panels, legend_height);
  const double top = legend_height + kTitle, bottom = top + kPlotHeight;
  const double caption_top = bottom + kBottomMargin + 14.0;
  const double height = caption_top + kCaptionRow * static_cast<double>(caption.size());
  std::string svg = format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" width=\"%.0f\" height=\"%.0f\" "
      "font-family=\"DejaVu Sans, Verdana, Arial, sans-serif\" font-size=\"13\" fill=\"%s\">\n",
      kWidth, height, kWidth, height, kInk);
  svg +=
      "<style>.title{font-weight:bold}.soft{fill:#555;font-size:12px}</style>\n"
      "<defs><pattern id=\"hatch\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" "
      "patternTransform=\"rotate(45)\"><line x1=\"0\" y1=\"0\" x2=\"0\" y2=\"6\" stroke=\"white\" "
      "stroke-width=\"1.6\"/></pattern></defs>\n";
  svg += format("<rect width=\"%.0f\" height=\"%.0f\" fill=\"white\"/>\n", kWidth, height) + legend;
  const double share = kWidth / static_cast<double>(panels.size());
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const double left = share * static_cast<double>(i);
    svg += draw_panel({panels[i], left + kLeftMargin, top, left + share - kRightMargin, bottom});
  }
  for (std::size_t i = 0; i < caption.size(); ++i) {
    svg += text(kLeftMargin - 65.0, caption_top + kCaptionRow * static_cast<double>(i), caption[i], "start",
                "class=\"soft\"");
  }
  return svg + "</svg>\n";
}

}  // namespace dofusion
