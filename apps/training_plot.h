// The curves of a training run as a picture.
#pragma once

#include <string>

namespace dofusion {

// SVG of the log that the trainer writes (FILE.csv, its text): the loss at low, middle and high noise, and the share of
// validation scenes that stand, over millions of samples. Lines that cannot be read are left out.
std::string training_plot(const std::string& csv);

}  // namespace dofusion
