// Curves with bands and stacked bars as SVG text, readable in print.
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace dofusion {

struct PlotTick {
  double at = 0.0;
  std::string label;
  std::string below;  // a second line under it, may be empty
};

struct PlotAxis {
  std::string title;
  double low = 0.0, high = 1.0;
  bool logarithmic = false;
  std::vector<PlotTick> ticks;
  double floor = -std::numeric_limits<double>::infinity();  // smaller values are drawn here
};

struct PlotPoint {
  double x = 0.0, y = 0.0;
  double low = 0.0, high = 0.0;  // of the band
};

enum class Marker { kCircle, kSquare, kDiamond };

// Points that are not finite break the curve; what lies outside the axis is drawn at its border. Curves of one panel
// are drawn a few units beside one another, so that equal ones are both seen.
struct PlotCurve {
  std::string name, colour;
  Marker marker = Marker::kCircle;
  std::vector<PlotPoint> points;
};

// A horizontal line across the panel with its band.
struct PlotReference {
  std::string name, colour, dashes;  // SVG's stroke-dasharray
  double y = 0.0, low = 0.0, high = 0.0;
};

struct PlotLimit {
  double y = 0.0;
  std::string label;
};

// A bar of parts from the bottom up; heights in the axis' unit.
struct PlotBar {
  double x = 0.0;
  std::vector<double> parts;
};
struct PlotPart {
  std::string name, colour;
  bool hatched = false;  // besides its colour, so that neighbours differ in print
};

struct PlotPanel {
  std::string title;
  PlotAxis x, y;
  std::vector<PlotCurve> curves;
  std::vector<PlotReference> references;
  std::vector<PlotLimit> limits;  // thin grey lines with a label
  std::vector<PlotBar> bars;
  std::vector<PlotPart> parts;  // what the parts of the bars are
};

// Panels side by side under one legend (of the first panel's curves and references, and of all panels' parts), the
// caption's lines underneath. The width is 960 units.
std::string draw_figure(const std::vector<PlotPanel>& panels, const std::vector<std::string>& caption);

// Decades from `low` to `high` as ticks; the first label is "≤low", and there is a little room below it.
PlotAxis log_axis(const std::string& title, double low, double high);

}  // namespace dofusion
