// Depth image -> placements, through the library: what dofusion-place does, without its files.
#include <cstdio>

#include "apps/assets.h"
#include "apps/pipeline.h"
#include "apps/placement.h"
#include "apps/ranking.h"
#include "perception/depth_io.h"

using namespace dofusion;

int main(int argc, char** argv) try {
  if (argc != 3) return std::fprintf(stderr, "usage: place_example depth.png camera.json\n"), 2;
  const Camera camera = read_camera(argv[2]);
  const DepthImage depth = read_depth(argv[1], camera);

  const RecoveredScene recovered = recover_scene(depth, camera, {});  // nothing is known of the objects
  if (!recovered.table) return std::fprintf(stderr, "%s: no table\n", argv[1]), 1;

  const ObjectPtr query = make_block("hat");
  const PlacementModel model = PlacementModel::load(default_model_path());
  std::vector<Placement> placements = place(recovered.scene, query, model, {});
  const SceneSampler scenes(recovered, {}, {}, 0);  // what the scene may be instead
  rank_by_probability(scenes, query, {}, placements);

  const Placement& best = placements.front();
  const Eigen::Vector3d at = recovered.table->T_world_camera.inverse() * best.T_world_query.translation();
  std::printf("%zu objects; put the %s at %.3f %.3f %.3f m from the camera: it stands with a probability of %.2f\n",
              recovered.objects.size(), query->name.c_str(), at.x(), at.y(), at.z(),
              best.stable_probability.value_or(0.0));
  return best.stable ? 0 : 1;
} catch (const std::exception& e) {
  return std::fprintf(stderr, "place_example: %s\n", e.what()), 2;
}
