// Random fields over an image that change slowly from pixel to pixel.
#pragma once

#include "perception/image.h"
#include "stability/random.h"

namespace dofusion {

// Normal noise of mean 0 and standard deviation 1 at every pixel; that of two pixels r apart has the correlation
// exp(-(r / (2 length_px))^2), as white noise has after a Gaussian blur of `length_px`. 0: independent pixels. Time and
// memory do not grow with the length. Throws std::invalid_argument unless 0 <= length_px <= 1e4.
Image<float> smooth_noise(int width, int height, double length_px, Rng& rng);

// The value that a standard normal draw exceeds with the probability `share`; infinite at 0 and 1. `share` beyond
// [0, 1] counts as the nearer of them.
double normal_exceedance(double share);

}  // namespace dofusion
