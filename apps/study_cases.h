// The study's failures, looked at: which trials, and a page with their pictures.
#pragma once

#include <string>
#include <vector>

#include "apps/study.h"
#include "apps/study_rows.h"

namespace dofusion {

// Of every kind of failure (failure_names()) up to `each` trials, each of another scene: those whose noise scale is
// nearest to the sensor's own come first, then those in which more moved in the true scene. In the order of
// failure_names().
std::vector<StudyRow> worst_cases(const std::vector<StudyRow>& rows, int each = 3);

// One page, without a network: for every case what the first camera read, how it was segmented, the recovered scene
// with the placement, and the true scene with the placement as it is put there and as it comes to rest. Runs the cases
// again, on job.threads threads. Throws Interrupted after Ctrl-C.
std::string cases_html(const StudyJob& job, const std::vector<StudyRow>& cases);

}  // namespace dofusion
