#include "tests/diffusion/toy_scenes.h"

#include "stability/random.h"

namespace dofusion {
namespace {

Pose on_table(Rng& rng, double z) {
  const Eigen::AngleAxisd yaw(uniform(rng, 0.0, 2.0 * M_PI), Eigen::Vector3d::UnitZ());
  return make_pose(yaw.toRotationMatrix(), {uniform(rng, -0.1, 0.1), uniform(rng, -0.1, 0.1), z});
}

}  // namespace

SceneDataset boxes_on_table(int count, std::uint64_t seed) {
  SceneDataset dataset;
  dataset.settings = "{}";
  dataset.shapes = {make_box("box", {0.06, 0.10, 0.04})};
  Rng rng = make_rng(seed);
  for (int i = 0; i < count; ++i) {
    SceneRecord record;
    record.index = i;
    record.objects.resize(1);
    record.objects[0].T_world_object = on_table(rng, 0.02);
    record.objects[0].touches = 1;
    dataset.scenes.push_back(record);
  }
  return dataset;
}

SceneDataset stacked_cubes(int count, std::uint64_t seed) {
  SceneDataset dataset;
  dataset.settings = "{}";
  dataset.shapes = {make_block("cube")};
  Rng rng = make_rng(seed);
  for (int i = 0; i < count; ++i) {
    SceneRecord record;
    record.index = i;
    record.task = Task::kStack;
    record.objects.resize(2);
    record.objects[0].T_world_object = on_table(rng, 0.025);
    record.objects[1].T_world_object = record.objects[0].T_world_object;
    record.objects[1].T_world_object.translation().z() = 0.075;
    dataset.scenes.push_back(record);
  }
  return dataset;
}

}  // namespace dofusion
