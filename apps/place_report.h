// The report of dofusion-place: one HTML page with its pictures inside.
#pragma once

#include <string>
#include <vector>

#include "apps/place_job.h"

namespace dofusion {

// PNG files' bytes.
struct ReportPictures {
  std::string depth, segmentation, recovered;
  struct BeforeAfter {
    std::size_t rank = 0;  // from 1
    std::string before, after;
  };
  std::vector<BeforeAfter> best;  // the best placements, as generated and settled
};

// Rendered from the camera that took the depth image, by the scanner.
ReportPictures render_pictures(const PlaceInputs& inputs, const PlaceResult& result, int threads);

// The page; `glb`, the bytes of scene.glb, is what its 3D view shows if the toolkit was built with it.
std::string report_html(const PlaceInputs& inputs, const PlaceArguments& arguments, const PlaceResult& result,
                        const ReportPictures& pictures, const std::string& glb);

}  // namespace dofusion
