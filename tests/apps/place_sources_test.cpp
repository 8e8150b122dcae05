// dofusion-place on several views and on frames of a BOP dataset.
#include <cmath>
#include <cstring>
#include <filesystem>

#include "perception/depth_io.h"
#include "perception/segmentation.h"
#include "perception/synthetic_view.h"
#include "stability/files.h"
#include "tests/apps/place_fixture.h"

namespace dofusion {
namespace {

using nlohmann::json;

json rows_of(const Pose& pose) {
  json rows = json::array();
  for (int r = 0; r < 4; ++r) rows.push_back({pose(r, 0), pose(r, 1), pose(r, 2), pose(r, 3)});
  return rows;
}

// The recovered objects stand where the true ones do, in the frame that the poses were given in.
void expect_at_the_truth(const json& result, const Scene& truth) {
  const Pose T_given_world = pose_from_json(result.at("T_given_world"));
  ASSERT_EQ(result.at("objects").size(), truth.objects.size());
  for (const json& object : result.at("objects")) {
    const Eigen::Vector3d at = (T_given_world * pose_from_json(object.at("T_world_object"))).translation();
    double nearest = 1.0;
    for (const Pose& pose : truth.T_world_object) nearest = std::min(nearest, (pose.translation() - at).norm());
    EXPECT_LT(nearest, 0.004) << object.at("name");  // half-size images of unknown objects with noise of 2 mm
  }
}

class PlaceSourcesTest : public PlaceTest {
 protected:
  // a.png, b.png and their poses in the true world.
  void write_views() {
    const Camera camera = small_camera();
    write_camera(camera, file("camera.json"));
    const Scene scene = two_blocks();
    Scanner scanner(scene.objects);
    scanner.set_poses(scene.T_world_object);
    Rng rng = make_rng(11);
    for (const std::string name : {"a", "b"}) {
      const double azimuth = name == "a" ? 0.3 : 2.5;
      const Pose T_world_camera =
          look_at({0.5 * std::cos(azimuth), 0.5 * std::sin(azimuth), 0.45}, scene_centre(scene));
      write_depth(make_synthetic_view(scanner.render(camera, T_world_camera), camera, T_world_camera, {}, rng).depth,
                  camera, file(name + ".png"));
      write_file(file(name + ".json"), json{{"T_world_camera", rows_of(T_world_camera)}}.dump());
    }
  }
  std::vector<std::string> view(const std::string& name) const {
    return {"--view", file(name + ".png"), file("camera.json"), file(name + ".json")};
  }
  CommandResult place_views(std::vector<std::string> more = {}) {
    std::vector<std::string> words = view("a");
    for (const std::string& word : view("b")) words.push_back(word);
    words.insert(words.end(), more.begin(), more.end());
    for (const char* word : {"--query", "cube", "--samples", "4", "--steps", "10", "--threads", "2"})
      words.push_back(word);
    words.push_back("--out");
    words.push_back(out());
    return run_command("dofusion-place", words);
  }
};

// Readings that scene.glb shows.
int shown_readings(const std::string& out) {
  const std::string file = read_file(out + "/scene.glb");
  std::uint32_t length = 0;
  std::memcpy(&length, file.data() + 12, sizeof length);
  const json gltf = json::parse(file.substr(20, length));
  for (const json& node : gltf.at("nodes")) {
    if (node.at("name") != "observed") continue;
    const json& attributes =
        gltf.at("meshes").at(node.at("mesh").get<std::size_t>()).at("primitives").at(0).at("attributes");
    return gltf.at("accessors").at(attributes.at("POSITION").get<std::size_t>()).at("count");
  }
  return 0;
}

TEST_F(PlaceSourcesTest, TwoViewsGiveOneSceneInTheirFrame) {
  write_views();
  for (const std::vector<std::string>& objects :
       {std::vector<std::string>{}, {"--objects", std::string(DOFUSION_ASSETS_DIR) + "/blocks"}}) {
    expect_success(place_views(objects));
    expect_at_the_truth(placements(), two_blocks());
    EXPECT_EQ(count_objects(segmentation(small_camera())), 2);
  }
  const int of_both = shown_readings(out());
  std::filesystem::remove_all(out());
  expect_success(place({"--camera", file("camera.json"), "--depth", file("a.png")}));
  EXPECT_GT(of_both, 1.1 * shown_readings(out()));  // twice as many, of which every other one is shown
}

TEST_F(PlaceSourcesTest, BadViewsAreRefused) {
  write_views();
  expect_refusal(place_views({"--camera", file("camera.json")}), {"--camera", "--view"});
  expect_refusal(place_views({"--depth", file("a.png")}), {"--depth", "--view"});
  expect_refusal(place_views({"--mask", file("a.png")}), {"--mask", "--view"});
  write_file(file("b.json"), "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]");
  expect_refusal(place_views(), {"b.json", "rigid"});
  write_file(file("b.json"), "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]");
  expect_refusal(place_views(), {"b.json", "4 rows of 4"});
  write_file(file("b.json"), "{\"pose\": 1}");
  expect_refusal(place_views(), {"b.json", "T_world_camera"});
  write_file(file("b.json"), "1 0 0");
  expect_refusal(place_views(), {"b.json", "JSON"});
  EXPECT_FALSE(std::filesystem::exists(out()));
}

TEST_F(PlaceSourcesTest, FramesOfADatasetThatDofusionScanWrote) {
  expect_success(run_command(
      "dofusion-scan", {"--objects", "2", "--count", "1", "--cameras", "3", "--seed", "12", "--out", file("bop")}));
  const std::vector<std::string> common = {"--query", "hat",   "--samples", "4",     "--steps",
                                           "10",      "--out", out(),       "--bop", file("bop")};
  const auto place_bop = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = common;
    words.insert(words.end(), more.begin(), more.end());
    return run_command("dofusion-place", words);
  };
  expect_success(place_bop({"--scene", "0", "--image", "1", "--bop-models"}));
  const json one = placements();
  EXPECT_TRUE(one.contains("T_given_world"));
  ASSERT_EQ(one.at("objects").size(), 2u);
  EXPECT_TRUE(one.at("objects").at(0).at("known").get<bool>());
  EXPECT_LT(pose_from_json(one.at("T_given_world")).translation().z(),
            0.002);  // the dataset's world has its table at 0
  expect_success(place_bop({"--image", "0", "--image", "1", "--image", "2"}));
  EXPECT_EQ(placements().at("objects").size(), 2u);
  expect_refusal(place_bop({"--image", "9"}), {"scene_camera.json", "no image 9"});
  expect_refusal(place_bop({"--depth", file("a.png")}), {"--depth", "--bop"});
}

}  // namespace
}  // namespace dofusion
