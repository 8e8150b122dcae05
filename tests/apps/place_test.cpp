// dofusion-place on a synthetic scan: what it writes is whole, consistent and stands in MuJoCo.
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <set>

#include <mujoco/mujoco.h>

#include "perception/depth_io.h"
#include "stability/files.h"
#include "stability/mesh_io.h"
#include "stability/metrics.h"
#include "stability/physics.h"
#include "tests/apps/place_fixture.h"

namespace dofusion {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

const std::string kBlocks = std::string(DOFUSION_ASSETS_DIR) + "/blocks";

void expect_keys(const json& object, const std::set<std::string>& keys) {
  for (const std::string& key : keys) EXPECT_TRUE(object.contains(key)) << key << " of " << object.dump().substr(0, 200);
}

void check_placements(const json& result) {
  const Pose T_world_camera = pose_from_json(result.at("T_world_camera"));
  int rank = 1;
  bool stable = true;
  for (const json& p : result.at("placements")) {
    SCOPED_TRACE(rank);
    EXPECT_EQ(p.at("rank").get<int>(), rank++);
    const Pose T_world_query = pose_from_json(p.at("T_world_query")), T_camera_query = pose_from_json(p.at("T_camera_query"));
    EXPECT_TRUE((T_world_camera.inverse() * T_world_query).matrix().isApprox(T_camera_query.matrix(), 1e-9));
    EXPECT_TRUE(stable || !p.at("stable").get<bool>()) << "a stable placement after one that is not";
    stable = p.at("stable").get<bool>();
    EXPECT_TRUE(p.at("translational_displacement_pct").is_number() || !stable);
    if (stable) {
      EXPECT_LE(p.at("translational_displacement_pct").get<double>(), kStableTranslationPct);
      EXPECT_LE(p.at("rotational_displacement_deg").get<double>(), kStableRotationDeg);
    }
    EXPECT_GE(p.at("penetration_m").get<double>(), 0.0);
    if (!p.at("robustness").is_null()) {
      EXPECT_GE(p.at("robustness").get<double>(), 0.0);
      EXPECT_LE(p.at("robustness").get<double>(), 1.0);
    }
    EXPECT_TRUE(p.at("status").is_string());
  }
}

// Everything the contract says of placements.json and of the files it names.
void check_outputs(const std::string& out, const json& result, const LabelImage& labels) {
  expect_keys(result, {"format", "version", "seed", "T_world_camera", "objects", "query", "placements", "timing_ms"});
  EXPECT_EQ(result.at("format"), "dofusion-placements");
  EXPECT_EQ(result.at("version").get<int>(), 1);
  std::vector<int> pixels(256, 0);
  for (const std::uint8_t label : labels.pixels) ++pixels[label];
  const std::size_t n = result.at("objects").size();
  for (std::size_t label = 2 + n; label < 256; ++label) EXPECT_EQ(pixels[label], 0) << "label " << label;
  for (std::size_t i = 0; i < n; ++i) {
    const json& object = result.at("objects").at(i);
    EXPECT_EQ(object.at("index").get<std::size_t>(), i);
    EXPECT_TRUE(object.at("name").is_string());
    EXPECT_TRUE(object.at("known").is_boolean());
    EXPECT_EQ(object.at("pixels").get<int>(), pixels[2 + i]);
    EXPECT_EQ(object.at("mesh"), "objects/" + std::to_string(i) + ".obj");
    pose_from_json(object.at("T_world_object"));
    EXPECT_TRUE(is_closed(read_mesh(out + "/" + object.at("mesh").get<std::string>())));
  }
  EXPECT_TRUE(result.at("query").at("name").is_string());
  EXPECT_TRUE(is_closed(read_mesh(out + "/" + result.at("query").at("mesh").get<std::string>())));
  check_placements(result);
  const std::vector<const char*> steps = {"load", "segment", "recover", "sdf", "sample", "settle", "report", "total"};
  double sum = 0.0;
  for (const char* step : steps) sum += result.at("timing_ms").at(step).get<double>();
  // The total is the sum of the others, each rounded to 0.1 ms.
  EXPECT_NEAR(sum, 2.0 * result.at("timing_ms").at("total").get<double>(), 1.0);
}

// That its script asks for nothing from outside either, report_browser_test.mjs sees.
void check_report(const std::string& out) {
  const std::string whole = read_file(out + "/report.html"), html = whole.substr(0, whole.find("<script"));
  for (const char* outside : {"http:", "https:", "<link", "url("}) EXPECT_THAT(html, Not(HasSubstr(outside)));
  EXPECT_THAT(html, HasSubstr("default-src 'none'"));
  const std::string png = "data:image/png;base64,iVBORw0KGgo";  // a PNG's first eight bytes
  int pictures = 0;
  for (std::size_t at = html.find("src=\""); at != std::string::npos; at = html.find("src=\"", at + 1)) {
    EXPECT_EQ(html.compare(at + 5, png.size(), png), 0);
    ++pictures;
  }
  EXPECT_GE(pictures, 5);  // depth, segmentation, recovered scene, one placement before and after
  EXPECT_THAT(whole, HasSubstr("</html>"));
}

// scene.glb has a node for each object and the query, where placements.json puts them, and a motion per placement.
void check_glb(const std::string& out, const json& result) {
  const std::string file = read_file(out + "/scene.glb");
  std::uint32_t length = 0;
  std::memcpy(&length, file.data() + 12, sizeof length);
  const json gltf = json::parse(file.substr(20, length));
  std::vector<Pose> expected;
  for (const json& object : result.at("objects")) expected.push_back(pose_from_json(object.at("T_world_object")));
  expected.push_back(pose_from_json(result.at("placements").at(0).at("T_world_query")));
  std::size_t found = 0;
  for (const json& node : gltf.at("nodes")) {
    const std::string name = node.at("name");
    if (name.rfind("object ", 0) != 0 && name.rfind("query: ", 0) != 0) continue;
    ASSERT_LT(found, expected.size());
    const std::vector<double> t = node.at("translation"), q = node.at("rotation");
    const Pose pose = from_array({t[0], t[1], t[2], q[3], q[0], q[1], q[2]});
    EXPECT_TRUE(pose.isApprox(expected[found++], 1e-9)) << name;
  }
  EXPECT_EQ(found, expected.size());
  EXPECT_EQ(gltf.at("animations").size(), result.at("placements").size());
  for (const json& motion : gltf.at("animations")) EXPECT_EQ(motion.at("channels").size(), 2 * expected.size());
}

// scene.xml in MuJoCo's own loader: the poses are those of placements.json, and in two seconds nothing leaves the
// limits of stability if the best placement is said to be stable.
void check_scene(const std::string& out, const json& result) {
  char error[500] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(
      mj_loadXML((out + "/scene.xml").c_str(), nullptr, error, sizeof error), mj_deleteModel);
  ASSERT_NE(model, nullptr) << error;
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  std::vector<Pose> start;
  std::vector<double> diameters;
  for (const json& object : result.at("objects")) {
    start.push_back(pose_from_json(object.at("T_world_object")));
    diameters.push_back(diameter(read_mesh(out + "/" + object.at("mesh").get<std::string>())));
  }
  if (!result.at("placements").empty()) {
    start.push_back(pose_from_json(result.at("placements").at(0).at("T_world_query")));
    diameters.push_back(diameter(read_mesh(out + "/query.obj")));
  }
  ASSERT_EQ(model->njnt, static_cast<int>(start.size()));
  const auto pose_of = [&](std::size_t i) {
    PoseArray array;
    std::copy_n(data->qpos + model->jnt_qposadr[i], 7, array.begin());
    return from_array(array);
  };
  mj_forward(model.get(), data.get());
  // The text has nine digits, and mesh geoms are centred by MuJoCo in single precision.
  for (std::size_t i = 0; i < start.size(); ++i) EXPECT_TRUE(pose_of(i).matrix().isApprox(start[i].matrix(), 1e-6)) << i;
  while (data->time < 2.0) mj_step(model.get(), data.get());
  for (int w = 0; w < mjNWARNING; ++w) EXPECT_EQ(data->warning[w].number, 0) << mju_warningText(w, 0);
  if (result.at("placements").empty() || !result.at("placements").at(0).at("stable").get<bool>()) return;
  for (std::size_t i = 0; i < start.size(); ++i) {
    const Pose moved = start[i].inverse() * pose_of(i);
    EXPECT_LE(100.0 * moved.translation().norm() / diameters[i], kStableTranslationPct) << i;
    EXPECT_LE(rotation_angle(moved.linear()) * 180.0 / M_PI, kStableRotationDeg) << i;
  }
}

TEST_F(PlaceTest, SaysAsMuchAsIsAskedFor) {
  write_scan(scan_of(two_blocks(), small_camera()));
  const std::vector<std::string> arguments = {"--unknown", "--query", "cube", "--samples", "1", "--steps", "3"};
  const auto place_with = [&](const std::string& option) {
    std::filesystem::remove_all(out());
    std::vector<std::string> words = arguments;
    words.push_back(option);
    return place(words);
  };
  const CommandResult quiet = place_with("--quiet"), verbose = place_with("-v");
  expect_success(quiet);
  EXPECT_EQ(quiet.out + quiet.err, "");
  expect_success(verbose);
  EXPECT_THAT(verbose.out, HasSubstr("report: "));
  EXPECT_THAT(verbose.err, testing::AllOf(HasSubstr("model: "), HasSubstr("object 0: "), HasSubstr("1 candidates")));
  std::filesystem::remove_all(out());
  std::vector<std::string> both = arguments;
  both.insert(both.end(), {"-q", "-v"});
  expect_refused(both, {"--quiet"});
}

TEST_F(PlaceTest, KnownBlocksAreFoundAndTheOutputsAreWhole) {
  const TestScan scan = scan_of(two_blocks(), small_camera());
  write_scan(scan);
  const CommandResult run = place({"--objects", kBlocks, "--query", "cube", "--samples", "8", "--steps", "25", "--seed",
                                   "3", "--json", file("copy.json")});
  ASSERT_NO_FATAL_FAILURE(expect_success(run));
  EXPECT_THAT(run.out, HasSubstr("2 objects"));
  EXPECT_THAT(run.out, HasSubstr("report: " + out() + "/report.html"));
  EXPECT_EQ(entries(file("work")), std::vector<std::string>{"out"});
  EXPECT_EQ(entries(out()), (std::vector<std::string>{"objects", "placements.json", "query.obj", "report.html",
                                                      "scene.glb", "scene.xml", "segmentation.png"}));
  const json result = placements();
  EXPECT_EQ(json::parse(read_file(file("copy.json"))), result);
  check_outputs(out(), result, segmentation(scan.camera));
  check_report(out());
  check_glb(out(), result);
  check_scene(out(), result);

  EXPECT_EQ(result.at("status"), "ok");
  EXPECT_EQ(result.at("seed").get<int>(), 3);
  ASSERT_EQ(result.at("placements").size(), 8u);
  EXPECT_TRUE(result.at("placements").at(0).at("stable").get<bool>());  // two blocks far apart: an easy scene
  std::set<std::string> names;
  for (const json& object : result.at("objects")) {
    names.insert(object.at("name").get<std::string>());
    EXPECT_TRUE(object.at("known").get<bool>());
    EXPECT_EQ(entries(out() + "/objects").size(), 2u);
  }
  EXPECT_EQ(names, (std::set<std::string>{"cube", "half_rectangle"}));
}

// Parts that were never seen are marked in a form that MuJoCo and assimp (check_outputs) read past.
void check_marks(const std::string& out, const json& result) {
  for (const json& object : result.at("objects")) {
    const std::string file = out + "/" + object.at("mesh").get<std::string>();
    const std::string obj = read_file(file);
    EXPECT_THAT(obj, HasSubstr("usemtl never_seen\nf "));  // the bottom, at least
    EXPECT_THAT(obj, HasSubstr("usemtl seen\nf "));
    EXPECT_TRUE(fs::exists(fs::path(file).replace_extension(".mtl")));
    const std::string xml = out + "/../mesh.xml";
    write_file(xml, "<mujoco><asset><mesh name='m' file='" + file + "'/></asset><worldbody><geom type='mesh' mesh='m'/>"
                    "</worldbody></mujoco>");
    char error[500] = "";
    const std::unique_ptr<mjModel, void (*)(mjModel*)> model(mj_loadXML(xml.c_str(), nullptr, error, sizeof error),
                                                             mj_deleteModel);
    ASSERT_NE(model, nullptr) << error;
    EXPECT_EQ(model->nmeshface, static_cast<int>(read_mesh(file).triangles.size()));
    fs::remove(xml);
  }
}

TEST_F(PlaceTest, UnknownObjectsWithOneThreadAreReproducible) {
  const TestScan scan = scan_of(two_blocks(), small_camera());
  write_scan(scan);
  std::vector<json> results;
  for (int run = 0; run < 2; ++run) {
    expect_success(place({"--unknown", "--threads", "1", "--seed", "5", "--query", "hat"}));
    results.push_back(placements());
    results.back().erase("timing_ms");
  }
  EXPECT_EQ(results[0], results[1]);
  const json result = placements();
  check_outputs(out(), result, segmentation(scan.camera));
  check_report(out());
  check_glb(out(), result);
  check_scene(out(), result);
  check_marks(out(), result);
  ASSERT_EQ(result.at("objects").size(), 2u);
  EXPECT_FALSE(result.at("objects").at(0).at("known").get<bool>());
  EXPECT_EQ(result.at("query").at("name"), "hat");
}

TEST_F(PlaceTest, MaskSaysWhatTheObjectsAre) {
  TestScan scan = scan_of(two_blocks(), small_camera());
  write_scan(scan);
  for (std::uint8_t& label : scan.labels.pixels) label = label == 2 ? 255 : 0;  // the first block alone
  write_labels(scan.labels, file("mask.png"));
  expect_success(place({"--mask", file("mask.png")}));
  const json result = placements();
  check_outputs(out(), result, segmentation(scan.camera));
  ASSERT_EQ(result.at("objects").size(), 1u);
  const LabelImage found = segmentation(scan.camera);
  int inside = 0, all = 0;
  for (std::size_t i = 0; i < found.pixels.size(); ++i) {
    if (found.pixels[i] != 2) continue;
    ++all;
    inside += scan.labels.pixels[i] == 255 ? 1 : 0;
  }
  EXPECT_GT(all, 500);
  EXPECT_EQ(inside, all);
}

TEST_F(PlaceTest, CloudGivesTheSceneThatItsDepthImageGives) {
  const TestScan scan = scan_of(two_blocks(), small_camera());
  write_scan(scan);
  std::ofstream cloud(file("scene.pcd"));
  cloud << "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " << scan.depth.pixels.size() + 4
        << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " << scan.depth.pixels.size() + 4 << "\nDATA ascii\n"
        << "nan nan nan\ninf 0 1\n0 0 -1\n0 inf inf\n";  // what is no reading is left out
  for (int v = 0; v < scan.depth.height; ++v) {
    for (int u = 0; u < scan.depth.width; ++u) {
      const Eigen::Vector3d p = unproject(scan.camera, u, v, scan.depth.at(v, u));
      cloud << p.x() << " " << p.y() << " " << p.z() << "\n";
    }
  }
  cloud.close();
  expect_success(place({"--cloud", file("scene.pcd")}));
  const json of_cloud = placements();
  check_outputs(out(), of_cloud, segmentation(scan.camera));
  expect_success(place({}));
  const json of_image = placements();
  ASSERT_EQ(of_cloud.at("objects").size(), 2u);
  ASSERT_EQ(of_image.at("objects").size(), 2u);
  // Six printed digits and steps of 0.1 mm are far below the sensor's noise of 2 mm.
  const Pose a = pose_from_json(of_cloud.at("T_world_camera")), b = pose_from_json(of_image.at("T_world_camera"));
  EXPECT_LT((a.translation() - b.translation()).norm(), 1e-3);
}

TEST_F(PlaceTest, QueryMeshInMillimetresKeepsItsOriginOnRecord) {
  write_scan(scan_of(two_blocks(), small_camera()));
  // A box of 40 x 60 x 80 mm with a corner at the file's origin.
  write_obj(translated(scaled(make_block("cube")->mesh, Eigen::Vector3d(40, 60, 80) / 0.05), {20, 30, 40}), file("box.obj"));
  expect_success(place({"--query", file("box.obj"), "--query-unit", "0.001"}));
  const json result = placements();
  EXPECT_EQ(result.at("query").at("name"), "box");
  const std::vector<double> centre = result.at("query").at("origin_in_file"), expected = {0.02, 0.03, 0.04};
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(centre[k], expected[k], 1e-8);  // the reader has single precision
  EXPECT_NEAR(volume(read_mesh(out() + "/query.obj")), 0.04 * 0.06 * 0.08, 1e-9);
}

TEST_F(PlaceTest, SmallHolesOfTheQueryAreFilledAndSaid) {
  write_scan(scan_of(two_blocks(), small_camera()));
  TriangleMesh open = make_block("cube")->mesh;
  open.triangles.pop_back();
  write_obj(open, file("open.obj"));
  const CommandResult result = place({"--query", file("open.obj")});
  expect_success(result);
  EXPECT_NE(result.err.find("open.obj: 1 hole (3 open edges) filled, 8.3 % of the surface"), std::string::npos);
  EXPECT_NEAR(volume(read_mesh(out() + "/query.obj")), std::pow(0.05, 3), 1e-9);
}

TEST_F(PlaceTest, OtherFilesInTheOutputFolderStay) {
  write_scan(scan_of({}, small_camera()));
  fs::create_directories(out() + "/objects");
  write_file(out() + "/notes.txt", "mine");
  write_file(out() + "/objects/7.obj", "mine too");
  expect_success(place({}));
  EXPECT_EQ(read_file(out() + "/notes.txt"), "mine");
  EXPECT_EQ(read_file(out() + "/objects/7.obj"), "mine too");
  EXPECT_EQ(entries(file("work")), std::vector<std::string>{"out"});
  EXPECT_EQ(entries(out()).size(), 8u);
}

}  // namespace
}  // namespace dofusion
