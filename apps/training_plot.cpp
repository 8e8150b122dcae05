#include "apps/training_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <vector>

#include "apps/svg_plot.h"

namespace dofusion {
namespace {

struct LogLine {
  double samples_millions = 0.0;
  std::array<double, 3> loss{};  // at low, middle, high noise
  double validation = 0.0;       // share; NaN before the first
};

// Columns of the trainer's log: step, samples, seconds, samples a second, learning rate, gradient norm, loss, loss at
// low, middle and high noise, validation.
std::vector<LogLine> parse(const std::string& csv) {
  constexpr std::size_t kSamples = 1, kLoss = 7, kValidation = 10;
  std::vector<LogLine> lines;
  std::istringstream text(csv);
  std::string line, cell;
  std::getline(text, line);  // the header
  while (std::getline(text, line)) {
    std::vector<double> values;
    std::istringstream cells(line);
    while (std::getline(cells, cell, ',')) values.push_back(std::strtod(cell.c_str(), nullptr));
    if (values.size() <= kValidation) continue;
    lines.push_back(
        {1e-6 * values[kSamples], {values[kLoss], values[kLoss + 1], values[kLoss + 2]}, values[kValidation]});
  }
  return lines;
}

// At most `most` lines: each the mean of as many that follow one another, with the last validation among them.
std::vector<LogLine> thinned(const std::vector<LogLine>& lines, std::size_t most) {
  const std::size_t together = (lines.size() + most - 1) / most;
  std::vector<LogLine> result;
  for (std::size_t begin = 0; begin < lines.size(); begin += together) {
    const std::size_t end = std::min(begin + together, lines.size());
    LogLine mean;
    for (std::size_t i = begin; i < end; ++i) {
      const double share = 1.0 / static_cast<double>(end - begin);
      for (std::size_t k = 0; k < mean.loss.size(); ++k) mean.loss[k] += share * lines[i].loss[k];
      mean.samples_millions = lines[i].samples_millions;
      mean.validation = lines[i].validation;
    }
    result.push_back(mean);
  }
  return result;
}

std::string text_of(double value) {
  char text[24];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

PlotAxis linear_axis(const std::string& title, double low, double high, int ticks) {
  PlotAxis axis;
  axis.title = title;
  axis.low = low;
  axis.high = high;
  for (int i = 0; i <= ticks; ++i) {
    const double at = low + (high - low) * i / ticks;
    axis.ticks.push_back({at, text_of(at), ""});
  }
  return axis;
}

// A number of two or fewer digits at or above `value`.
double rounded_up(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(std::max(value, 1e-6))) - 1.0);
  return unit * std::ceil(value / unit / 4.0) * 4.0;
}

}  // namespace

std::string training_plot(const std::string& csv) {
  constexpr std::size_t kMostPoints = 40;  // of a curve, that markers may be told apart
  const std::vector<LogLine> lines = thinned(parse(csv), kMostPoints);
  const double last = lines.empty() ? 1.0 : lines.back().samples_millions;
  double highest = 0.1;
  for (const LogLine& line : lines)
    for (const double loss : line.loss)
      if (std::isfinite(loss)) highest = std::max(highest, loss);
  const PlotAxis samples = linear_axis("million samples", 0.0, rounded_up(last), 4);

  PlotPanel loss{
      "Loss by noise", samples, linear_axis("mean squared error", 0.0, rounded_up(highest), 4), {}, {}, {}, {}, {}};
  const std::array<const char*, 3> names = {"low noise", "middle", "high"}, colours = {"#1b6ca8", "#d1731f", "#4d8b31"};
  for (std::size_t i = 0; i < 3; ++i) {
    PlotCurve curve{names[i], colours[i], static_cast<Marker>(i), {}};
    for (const LogLine& line : lines)
      curve.points.push_back({line.samples_millions, line.loss[i], line.loss[i], line.loss[i]});
    loss.curves.push_back(std::move(curve));
  }
  PlotPanel stable{"Validation scenes that stand", samples, linear_axis("per cent", 0.0, 100.0, 4), {}, {}, {}, {}, {}};
  PlotCurve curve{"", "#1b6ca8", Marker::kCircle, {}};
  double before = std::nan("");
  for (const LogLine& line : lines) {
    if (!std::isfinite(line.validation) || line.validation == before) continue;
    before = line.validation;
    const double pct = 100.0 * line.validation;
    curve.points.push_back({line.samples_millions, pct, pct, pct});
  }
  stable.curves.push_back(std::move(curve));
  return draw_figure({loss, stable}, {"Losses are means since the line before; half is what no model can know where an "
                                      "object may stand anywhere on the table."});
}

}  // namespace dofusion
