#include "diffusion/config.h"

#include <gmock/gmock.h>

#include "stability/files.h"

namespace dofusion {
namespace {

using testing::HasSubstr;

std::string error_of(const std::string& text) {
  try {
    config_from_json(text, "file.json");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Config, SurvivesJson) {
  ModelConfig config = make_config(Preset::kPaper);
  config.widths = {32, 96};
  config.sigma_min = 0.0123;
  config.use_sdf = false;
  EXPECT_EQ(to_json(config_from_json(to_json(config), "text")), to_json(config));
}

TEST(Config, AbsentKeysKeepThePreset) {
  const ModelConfig config = config_from_json(R"({"points": 64})", "text");
  EXPECT_EQ(config.points, 64);
  EXPECT_EQ(config.widths, ModelConfig{}.widths);
}

TEST(Config, MistakesAreNamed) {
  EXPECT_THAT(error_of("{"), HasSubstr("not valid JSON"));
  EXPECT_THAT(error_of("[1]"), HasSubstr("object"));
  EXPECT_THAT(error_of(R"({"point": 64})"), HasSubstr("unknown setting 'point'"));
  EXPECT_THAT(error_of(R"({"points": "many"})"), HasSubstr("'points' has the wrong type"));
  EXPECT_THAT(error_of(R"({"preset": "best"})"), HasSubstr("paper or default"));
  EXPECT_THAT(error_of(R"({"preset": 3})"), HasSubstr("'preset'"));
  EXPECT_THAT(error_of(R"({"points": 0})"), HasSubstr("points must be"));
  EXPECT_THAT(error_of(R"({"widths": [33]})"), HasSubstr("multiples of 32"));
  EXPECT_THAT(error_of(R"({"sigma_max": 0.001})"), HasSubstr("sigma_min < sigma_max"));
}

}  // namespace
}  // namespace dofusion
