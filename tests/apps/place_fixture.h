// A synthetic scan of two blocks and dofusion-place run on it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "perception/camera.h"
#include "perception/image.h"
#include "stability/scene.h"
#include "tests/apps/run_command.h"
#include "tests/temporary_directory.h"

namespace dofusion {

// A cube and a half_rectangle that lie on the table, apart.
Scene two_blocks();

// A depth image of the scene from 0.7 m with the RealSense's noise; the same every time.
struct TestScan {
  Camera camera;
  DepthImage depth;
  LabelImage labels;  // the true ones
  Pose T_world_camera = Pose::Identity();
};
TestScan scan_of(const Scene& scene, const Camera& camera);
Camera small_camera();  // 320 x 240

class PlaceTest : public testing::Test {
 protected:
  // camera.json and depth.png in the test's folder.
  void write_scan(const TestScan& scan);
  std::string file(const std::string& name) const { return directory_ / name; }
  std::string out() const { return file("work/out"); }
  const std::filesystem::path& folder() const { return directory_.path(); }

  // dofusion-place --camera camera.json … --out work/out with few samples and steps, on camera.json and depth.png
  // unless `arguments` name others; an argument that is there twice counts once, the last one.
  CommandResult place(const std::vector<std::string>& arguments);

  // place() refuses and leaves nothing behind.
  void expect_refused(const std::vector<std::string>& arguments, const std::vector<std::string>& words);

  nlohmann::json placements() const;  // placements.json
  LabelImage segmentation(const Camera& camera) const;

 private:
  TemporaryDirectory directory_;
};

// The pose of a 4 x 4 matrix in JSON; fails unless it is a rigid motion.
Pose pose_from_json(const nlohmann::json& rows);

}  // namespace dofusion
