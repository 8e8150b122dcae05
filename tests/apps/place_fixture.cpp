#include "tests/apps/place_fixture.h"

#include <map>

#include "perception/depth_io.h"
#include "perception/picture.h"
#include "perception/synthetic_view.h"
#include "stability/files.h"

namespace dofusion {
namespace fs = std::filesystem;
namespace {

Pose upright(double x, double y, double z, double yaw) {
  return make_pose(so3_exp({0.0, 0.0, yaw}), Eigen::Vector3d(x, y, z));
}

}  // namespace

Scene two_blocks() {
  return {{make_block("cube"), make_block("half_rectangle")},
          {upright(-0.06, 0.0, 0.025, 0.4), upright(0.07, 0.02, 0.0125, -0.3)}};
}

Camera small_camera() { return resized(default_camera(), 0.5); }

TestScan scan_of(const Scene& scene, const Camera& camera) {
  SyntheticViewOptions options;
  options.viewpoint.min_elevation_deg = options.viewpoint.max_elevation_deg = 45.0;
  Rng rng = make_rng(7);
  const SyntheticView view = make_synthetic_view(scene, camera, options, rng);
  return {camera, view.depth, view.truth.labels, view.T_world_camera};
}

void PlaceTest::write_scan(const TestScan& scan) {
  write_camera(scan.camera, file("camera.json"));
  write_depth(scan.depth, scan.camera, file("depth.png"));
}

CommandResult PlaceTest::place(const std::vector<std::string>& arguments) {
  fs::create_directories(file("work"));
  std::map<std::string, std::string> values = {{"--camera", file("camera.json")}, {"--query", "cube"},
                                               {"--samples", "4"},                {"--steps", "10"},
                                               {"--threads", "2"},                {"--out", out()}};
  std::vector<std::string> words;
  bool image = false;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    image = image || arguments[i] == "--depth" || arguments[i] == "--cloud" || arguments[i] == "--no-image";
    if (arguments[i] == "--no-image") continue;
    if (i + 1 < arguments.size() && values.count(arguments[i]) == 1) {
      values[arguments[i]] = arguments[i + 1];
      ++i;
    } else {
      words.push_back(arguments[i]);
    }
  }
  if (!image) values["--depth"] = file("depth.png");
  for (const auto& [name, value] : values) {
    words.push_back(name);
    words.push_back(value);
  }
  return run_command("dofusion-place", words);
}

void PlaceTest::expect_refused(const std::vector<std::string>& arguments, const std::vector<std::string>& words) {
  SCOPED_TRACE(testing::PrintToString(arguments) + testing::PrintToString(words));
  const std::vector<std::string> before = entries(directory_.path());
  expect_refusal(place(arguments), words);
  EXPECT_TRUE(entries(file("work")).empty()) << "left: " << testing::PrintToString(entries(file("work")));
  std::vector<std::string> after = entries(directory_.path());
  after.erase(std::remove_if(after.begin(), after.end(),
                             [&](const std::string& name) {
                               return name == "work" && std::count(before.begin(), before.end(), name) == 0;
                             }),
              after.end());
  EXPECT_EQ(after, before);
}

nlohmann::json PlaceTest::placements() const { return nlohmann::json::parse(read_file(out() + "/placements.json")); }

LabelImage PlaceTest::segmentation(const Camera& camera) const {
  return read_labels(out() + "/segmentation.png", camera);
}

Pose pose_from_json(const nlohmann::json& rows) {
  EXPECT_EQ(rows.size(), 4u);
  Eigen::Matrix4d matrix;
  for (int r = 0; r < 4; ++r) {
    EXPECT_EQ(rows.at(r).size(), 4u);
    for (int c = 0; c < 4; ++c) matrix(r, c) = rows.at(r).at(c).get<double>();
  }
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  EXPECT_TRUE((R.transpose() * R).isApprox(Eigen::Matrix3d::Identity(), 1e-9));
  EXPECT_NEAR(R.determinant(), 1.0, 1e-9);
  EXPECT_EQ(matrix.row(3), Eigen::RowVector4d(0, 0, 0, 1));
  return Pose(matrix);
}

}  // namespace dofusion
