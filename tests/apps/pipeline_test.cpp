#include "apps/pipeline.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "stability/metrics.h"
#include "tests/perception/box_image.h"

namespace dofusion {
namespace {

const DepthSigma kSigma{0.0, 1.7e-3};

BoxImage two_boxes() {
  const Pose T_world_camera = look_at({0.45, 0.0, 0.5}, {0, 0, 0});
  return render_boxes({upright_box({0.05, 0.05, 0.05}, {0, -0.07, 0.025}, 0.3),
                       upright_box({0.10, 0.05, 0.025}, {0, 0.07, 0.0125}, -0.2)},
                      test_camera(), T_world_camera, kSigma, 1);
}

void expect_consistent(const RecoveredScene& recovered) {
  ASSERT_TRUE(recovered.table);
  ASSERT_EQ(recovered.scene.objects.size(), recovered.objects.size());
  for (std::size_t i = 0; i < recovered.objects.size(); ++i) {
    const RecoveredObject& object = recovered.objects[i];
    EXPECT_EQ(object.label, kLabelFirstObject + static_cast<int>(i));
    EXPECT_EQ(object.pixels, std::count(recovered.labels.pixels.begin(), recovered.labels.pixels.end(), object.label));
    EXPECT_EQ(object.object, recovered.scene.objects[i]);
    EXPECT_EQ(object.T_world_object.matrix(), recovered.scene.T_world_object[i].matrix());
  }
}

TEST(RecoverScene, UnknownBoxesRestOnTheTable) {
  const RecoveredScene recovered = recover_scene(two_boxes().depth, test_camera(), {});
  expect_consistent(recovered);
  ASSERT_EQ(recovered.objects.size(), 2u);
  // It is at rest: settling once more is within the limits by far.
  Simulator simulator(recovered.scene.objects);
  const SettleResult settled = simulator.settle(recovered.scene.T_world_object);
  EXPECT_EQ(settled.status, SettleStatus::kSettled);
  EXPECT_LT(displacement(recovered.scene.objects, recovered.scene.T_world_object, settled.T_world_object).translation_pct, 1.0);
}

TEST(RecoverScene, KnownBlocksHaveTheirNames) {
  SceneRecoveryOptions options;
  options.library = all_blocks();
  const RecoveredScene recovered = recover_scene(two_boxes().depth, test_camera(), options);
  expect_consistent(recovered);
  ASSERT_EQ(recovered.objects.size(), 2u);
  std::vector<std::string> names = {recovered.objects[0].name, recovered.objects[1].name};
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"cube", "half_rectangle"}));
}

TEST(RecoverScene, MaskJoinsWhatTheUserSaysIsOne) {
  const BoxImage image = two_boxes();
  SceneRecoveryOptions options;
  options.mask = image.labels;
  for (std::uint8_t& label : options.mask->pixels) label = label >= 2 ? 255 : 0;
  const RecoveredScene recovered = recover_scene(image.depth, test_camera(), options);
  expect_consistent(recovered);
  EXPECT_EQ(recovered.objects.size(), 1u);
}

TEST(RecoverScene, SeveralViewsAreOneScene) {
  std::vector<View> views;
  for (const double azimuth : {0.1, 2.3}) {
    const Pose T_world_camera = look_at({0.45 * std::cos(azimuth), 0.45 * std::sin(azimuth), 0.5}, {0, 0, 0});
    const BoxImage image = render_boxes({upright_box({0.05, 0.05, 0.05}, {0, -0.07, 0.025}, 0.3),
                                         upright_box({0.10, 0.05, 0.025}, {0, 0.07, 0.0125}, -0.2)},
                                        test_camera(), T_world_camera, kSigma, 1);
    views.push_back({image.depth, test_camera(), T_world_camera, {}});
  }
  SceneRecoveryOptions options;
  for (const bool known : {false, true}) {
    if (known) options.library = all_blocks();
    const RecoveredScene recovered = recover_scene(views, options);
    expect_consistent(recovered);
    EXPECT_EQ(recovered.objects.size(), 2u);
  }
  options.mask = LabelImage(test_camera().width, test_camera().height);
  EXPECT_THROW(recover_scene(views, options), std::invalid_argument);
  EXPECT_THROW(recover_scene(std::vector<View>{}, {}), std::invalid_argument);
}

TEST(RecoverScene, NothingOnTheTableAndNoTable) {
  const Pose T_world_camera = look_at({0.45, 0.0, 0.5}, {0, 0, 0});
  const RecoveredScene empty = recover_scene(render_boxes({}, test_camera(), T_world_camera, kSigma, 1).depth, test_camera(), {});
  ASSERT_TRUE(empty.table);
  EXPECT_TRUE(empty.objects.empty());
  EXPECT_TRUE(empty.scene.objects.empty());
  EXPECT_EQ(count_objects(empty.labels), 0);
  const RecoveredScene nothing = recover_scene(DepthImage(320, 240), test_camera(), {});
  EXPECT_FALSE(nothing.table);
  EXPECT_TRUE(nothing.objects.empty());
}

}  // namespace
}  // namespace dofusion
