#include "apps/training_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dofusion {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::string kHeader =
    "step,samples,seconds,samples_per_second,learning_rate,gradient_norm,loss,loss_low,loss_middle,loss_high,"
    "validation\n";

std::string line(int samples, double loss, const std::string& validation) {
  const std::string value = std::to_string(loss);
  return "1," + std::to_string(samples) + ",1,1,1,1," + value + "," + value + "," + value + "," + value + "," +
         validation + "\n";
}

std::size_t occurrences(const std::string& text, const std::string& of) {
  std::size_t count = 0;
  for (std::size_t at = text.find(of); at != std::string::npos; at = text.find(of, at + 1)) ++count;
  return count;
}

TEST(TrainingPlot, DrawsAPointForEachLineAndEachValidation) {
  const std::string csv = kHeader + line(1000000, 0.9, "nan") + line(2000000, 0.7, "0.5") + line(3000000, 0.6, "0.5") +
                          line(4000000, 0.5, "0.75");
  const std::string plot = training_plot(csv), empty = training_plot(kHeader);
  EXPECT_THAT(plot, HasSubstr("million samples"));
  // Circles: of the loss at low noise four, of the validation two; in the legend one, as without any line.
  EXPECT_EQ(occurrences(plot, "<circle") - occurrences(empty, "<circle"), 6u);
  EXPECT_THAT(plot, Not(HasSubstr("nan")));
}

TEST(TrainingPlot, ThinsLongRunsAndSkipsWhatItCannotRead) {
  std::string csv = kHeader;
  for (int i = 1; i <= 1000; ++i) csv += line(1000 * i, 0.5, "nan");
  const std::string empty = training_plot(kHeader), plot = training_plot(csv);
  EXPECT_EQ(occurrences(plot, "<circle") - occurrences(empty, "<circle"), 40u);
  EXPECT_EQ(training_plot(csv + "1,2,3\nnonsense\n"), plot);
  EXPECT_EQ(training_plot(""), empty);
}

}  // namespace
}  // namespace dofusion
