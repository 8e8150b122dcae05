// The figures of a study's report as SVG.
#pragma once

#include <string>
#include <vector>

#include "apps/study_config.h"
#include "apps/study_summary.h"

namespace dofusion {

// Of the first series: median displacement against noise in the recovered and in the true scene, with 95 % bands and
// the two references: translation on the left, rotation on the right.
std::string displacement_svg(const StudySummary& summary, const StudyConfig& config);

// Of the first series: the share of scenes that are recovered and of placements that stand, and what failed first in
// the others.
std::string success_svg(const StudySummary& summary, const StudyConfig& config);

// All series beside one another, in the true scene: the share of placements that stand, and the median translation.
std::string series_svg(const StudySummary& summary);

// What the figures and the text around them share.
std::string plain(double value);                   // "0.7", "4"
const std::vector<std::string>& failure_titles();  // for people, in the order of failure_names()

}  // namespace dofusion
