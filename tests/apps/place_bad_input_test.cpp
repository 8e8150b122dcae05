// dofusion-place on bad input: one line that names the file and what is wrong, exit status 2, nothing left behind.
#include <fstream>

#include "diffusion/weights.h"
#include "perception/depth_io.h"
#include "perception/png.h"
#include "stability/files.h"
#include "stability/mesh_io.h"
#include "tests/apps/place_fixture.h"

namespace dofusion {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;

// `png` with one more chunk, whose checksum is right (PNG specification, section 5.5).
std::string with_chunk(std::string png, const std::string& type, const std::string& data) {
  const auto append = [&](std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) png += static_cast<char>(value >> shift & 0xff);
  };
  append(static_cast<std::uint32_t>(data.size()));
  png += type + data;
  std::uint32_t crc = 0xffffffffu;
  for (const char c : type + data) {
    crc ^= static_cast<unsigned char>(c);
    for (int k = 0; k < 8; ++k) crc = (crc & 1u) != 0 ? 0xedb88320u ^ crc >> 1 : crc >> 1;
  }
  append(~crc);
  return png;
}

class PlaceBadInputTest : public PlaceTest {
 protected:
  void SetUp() override {
    camera_ = small_camera();
    write_scan({camera_, DepthImage(camera_.width, camera_.height, 0.7F), {}, Pose::Identity()});
  }
  json camera_json() const { return json::parse(read_file(file("camera.json"))); }
  Camera camera_;
};

TEST_F(PlaceBadInputTest, DepthImage) {
  expect_refused({"--depth", file("none.png")}, {"none.png", "no such file"});
  expect_refused({"--depth", folder()}, {folder().string(), "directory"});
  const std::string whole = read_file(file("depth.png"));
  for (const std::size_t size : {std::size_t{0}, std::size_t{4}, std::size_t{20}, whole.size() / 2, whole.size() - 1}) {
    write_file(file("cut.png"), whole.substr(0, size));
    expect_refused({"--depth", file("cut.png")}, {"cut.png", size == 0 ? "empty" : size == 4 ? "not a PNG" : "truncated"});
  }
  std::string damaged = whole;
  damaged[whole.size() / 2] ^= 0x10;
  write_file(file("damaged.png"), damaged);
  expect_refused({"--depth", file("damaged.png")}, {"damaged.png", "damaged"});
  write_file(file("jpeg.png"), "\xff\xd8\xff\xe0 JFIF");
  expect_refused({"--depth", file("jpeg.png")}, {"jpeg.png", "not a PNG"});
  write_labels(LabelImage(camera_.width, camera_.height, 7), file("8bit.png"));
  expect_refused({"--depth", file("8bit.png")}, {"8bit.png", "8 bits", "16"});
  const std::vector<unsigned char> rgb(static_cast<std::size_t>(camera_.width) * camera_.height * 3, 90);
  write_file(file("rgb.png"), encode_rgb_png(rgb.data(), camera_.width, camera_.height));
  expect_refused({"--depth", file("rgb.png")}, {"rgb.png", "3 channel"});
  write_depth(DepthImage(100, 80, 0.7F), camera_, file("small.png"));
  expect_refused({"--depth", file("small.png")}, {"small.png", "100x80", "320x240"});
  write_depth(DepthImage(camera_.width, camera_.height), camera_, file("dark.png"));
  expect_refused({"--depth", file("dark.png")}, {"dark.png", "no pixel has a depth reading"});
}

TEST_F(PlaceBadInputTest, CompressedDataOfAPngCutInsideAWholeFile) {
  // Chunks and checksums are right, the compressed stream within ends early: only the decoder can tell.
  const std::string whole = read_file(file("depth.png"));
  const std::size_t at = whole.find("IDAT") - 4;
  const std::string crafted = with_chunk(whole.substr(0, at), "IDAT", whole.substr(at + 8, 20)) ;
  write_file(file("crafted.png"), with_chunk(crafted, "IEND", ""));
  expect_refused({"--depth", file("crafted.png")}, {"crafted.png", "cannot be decoded"});
}

TEST_F(PlaceBadInputTest, Camera) {
  expect_refused({"--camera", file("none.json")}, {"none.json", "no such file"});
  write_file(file("c.json"), "fx = 5");
  expect_refused({"--camera", file("c.json")}, {"c.json", "JSON"});
  write_file(file("c.json"), "[1, 2, 3]");
  expect_refused({"--camera", file("c.json")}, {"c.json", "object"});
  write_file(file("c.json"), "");
  expect_refused({"--camera", file("c.json")}, {"c.json", "JSON"});
  write_file(file("c.json"), std::string(100000, '['));
  expect_refused({"--camera", file("c.json")}, {"c.json", "JSON"});
  for (const char* field : {"fx", "fy", "cx", "cy", "width", "height", "depth_scale"}) {
    json camera = camera_json();
    camera.erase(field);
    write_file(file("c.json"), camera.dump());
    expect_refused({"--camera", file("c.json")}, {"c.json", field, "missing"});
    camera[field] = "500";
    write_file(file("c.json"), camera.dump());
    expect_refused({"--camera", file("c.json")}, {"c.json", field, "number"});
  }
  for (const char* field : {"fx", "fy", "width", "height", "depth_scale"}) {
    for (const double value : {0.0, -1.0}) {
      json camera = camera_json();
      camera[field] = value;
      write_file(file("c.json"), camera.dump());
      expect_refused({"--camera", file("c.json")}, {"c.json", field, "positive"});
    }
  }
  json camera = camera_json();
  camera["width"] = 320.5;
  write_file(file("c.json"), camera.dump());
  expect_refused({"--camera", file("c.json")}, {"c.json", "width", "whole"});
  camera["width"] = camera["height"] = 60000;
  write_file(file("c.json"), camera.dump());
  expect_refused({"--camera", file("c.json")}, {"c.json", "60000", "pixels"});
}

TEST_F(PlaceBadInputTest, QueryMesh) {
  expect_refused({"--query", "cubus"}, {"cubus", "neither a mesh file nor a block", "tetrahedron"});
  expect_refused({"--query", ""}, {"--query"});
  expect_refused({"--query", folder()}, {folder().string(), "no such mesh file"});
  write_file(file("m.obj"), "");
  expect_refused({"--query", file("m.obj")}, {"m.obj"});
  write_file(file("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  expect_refused({"--query", file("m.obj")}, {"m.obj"});
  write_file(file("m.stl"), std::string(90, 'x'));
  expect_refused({"--query", file("m.stl")}, {"m.stl"});
  write_file(file("m.xyz"), "0 0 0");
  expect_refused({"--query", file("m.xyz")}, {"m.xyz", "not a mesh"});
  const TriangleMesh cube = make_block("cube")->mesh;
  TriangleMesh open = cube;
  open.triangles.resize(open.triangles.size() - 2);  // one of twelve would be filled
  write_obj(open, file("m.obj"));
  expect_refused({"--query", file("m.obj")}, {"m.obj", "open", "16.7 %"});
  TriangleMesh flat = cube;
  for (Eigen::Vector3d& v : flat.vertices) v.z() = 0.0;
  write_obj(flat, file("m.obj"));
  expect_refused({"--query", file("m.obj")}, {"m.obj"});
  for (const char* value : {"nan", "inf", "1e39"}) {
    std::string text = to_obj(cube);
    text.replace(text.find("v ") + 2, 1, std::string(value) + " ");
    write_file(file("m.obj"), text);
    expect_refused({"--query", file("m.obj")}, {"m.obj"});
  }
  write_obj(cube, file("m.obj"));
  expect_refused({"--query", file("m.obj"), "--query-unit", "1000"}, {"m.obj", "86", "--query-unit"});
  expect_refused({"--query", file("m.obj"), "--query-unit", "1e-6"}, {"m.obj", "--query-unit"});
  expect_refused({"--query", file("m.obj"), "--query-unit", "0"}, {"--query-unit"});
}

// OBJ text of separate tetrahedra on a grid.
std::string tetrahedra(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d at(i % 160, i / 160, 0);
    for (const Eigen::Vector3d& corner : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.5, 0, 0), Eigen::Vector3d(0, 0.5, 0),
                                          Eigen::Vector3d(0, 0, 0.5)}) {
      const Eigen::Vector3d v = at + corner;
      text += "v " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) + "\n";
    }
    text += "f -4 -2 -3\nf -4 -3 -1\nf -4 -1 -2\nf -3 -2 -1\n";
  }
  return text;
}

TEST_F(PlaceBadInputTest, MeshesOfTooManyTriangles) {
  write_file(file("m.obj"), tetrahedra(25001));
  expect_refused({"--query", file("m.obj"), "--query-unit", "1e-3"}, {"m.obj", "100004 triangles", "simplify"});
  fs::create_directories(file("large"));
  write_file(file("large/m.obj"), tetrahedra(250000));
  for (const std::string option : {"--query", "--objects"}) {
    const std::string path = option == "--query" ? file("large/m.obj") : file("large");
    const CommandResult run = place({option, path, option + "-unit", "1e-3"});
    expect_refusal(run, {"large/m.obj", "1000000 triangles", "simplify it to 100000"});
    EXPECT_LT(run.peak_mb, 1000.0);  // of this process and of assimp's
  }
}

TEST_F(PlaceBadInputTest, Objects) {
  expect_refused({"--objects", file("none")}, {"none", "folder"});
  expect_refused({"--objects", file("depth.png")}, {"depth.png", "folder"});
  fs::create_directories(file("meshes"));
  expect_refused({"--objects", file("meshes")}, {"meshes", "no .obj"});
  write_obj(make_block("cube")->mesh, file("meshes/a.obj"));
  write_file(file("meshes/b.obj"), "v 0 0 0\n");
  expect_refused({"--objects", file("meshes")}, {"meshes/b.obj"});
  expect_refused({"--objects", file("meshes"), "--unknown"}, {"--unknown", "--objects"});
}

TEST_F(PlaceBadInputTest, Mask) {
  expect_refused({"--mask", file("none.png")}, {"none.png", "no such file"});
  write_labels(LabelImage(64, 48, 2), file("mask.png"));
  expect_refused({"--mask", file("mask.png")}, {"mask.png", "64x48", "320x240"});
  expect_refused({"--mask", file("depth.png")}, {"depth.png", "8 bits"});
}

TEST_F(PlaceBadInputTest, Cloud) {
  expect_refused({"--cloud", file("none.pcd")}, {"none.pcd", "no such"});
  expect_refused({"--cloud", file("depth.png")}, {"depth.png", ".pcd or .ply"});
  for (const char* name : {"c.pcd", "c.ply"}) {
    for (const std::string& text : {std::string(), std::string(1000, '\7'), std::string("ply\n"), std::string("VERSION 0.7\n")}) {
      write_file(file(name), text);
      expect_refused({"--cloud", file(name)}, {name, "damaged"});
    }
  }
  const auto pcd = [&](const std::string& points, const std::string& data) {
    write_file(file("c.pcd"), "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " + points +
                                  "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + points + "\nDATA " + data);
  };
  pcd("2", "ascii\n0 0 1\n");  // fewer points than the header says
  expect_refused({"--cloud", file("c.pcd")}, {"c.pcd", "damaged"});
  pcd("3000000000", "binary\n0123456789");  // a header that asks for 36 GB
  expect_refused({"--cloud", file("c.pcd")}, {"c.pcd", "damaged"});
  pcd("1000000", "binary_compressed\n\x10\x27\x00\x00\x10\x27\x00\x00garbage");
  expect_refused({"--cloud", file("c.pcd")}, {"c.pcd", "damaged"});
  pcd("2", "ascii\nnan nan nan\n0 0 -1\n");  // whole, and without a point before the camera
  expect_refused({"--cloud", file("c.pcd")}, {"c.pcd", "camera's frame"});
  write_file(file("c.ply"), "ply\nformat binary_little_endian 1.0\nelement vertex 3000000000\nproperty float x\n"
                            "property float y\nproperty float z\nend_header\n0123456789");
  expect_refused({"--cloud", file("c.ply")}, {"c.ply", "damaged"});
  write_file(file("c.ply"), "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
                            "property float z\nend_header\n0 0 1\n0 x");
  expect_refused({"--cloud", file("c.ply")}, {"c.ply", "damaged"});
}

TEST_F(PlaceBadInputTest, AMillionRandomPointsHoldNoTable) {
  Rng rng = make_rng(6);
  std::string points;
  constexpr int kPoints = 1000000;
  for (int i = 0; i < kPoints; ++i) {
    const float p[] = {static_cast<float>(uniform(rng, -1, 1)), static_cast<float>(uniform(rng, -1, 1)),
                       static_cast<float>(uniform(rng, 0.2, 2))};
    points.append(reinterpret_cast<const char*>(p), sizeof p);
  }
  const std::string count = std::to_string(kPoints);
  write_file(file("c.pcd"), "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " + count +
                                "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + count + "\nDATA binary\n" + points);
  const CommandResult run = place({"--cloud", file("c.pcd")});
  expect_success(run);
  EXPECT_EQ(placements().at("status"), "no_table");
  EXPECT_LT(run.peak_mb, 1000.0);
}

TEST_F(PlaceBadInputTest, Output) {
  expect_refused({"--out", file("depth.png")}, {"depth.png", "file"});
  expect_refused({"--out", file("depth.png") + "/below/out"}, {"depth.png/below/out", "cannot be created"});
  expect_refused({"--out", "/proc/dofusion/out"}, {"/proc/dofusion/out", "cannot be created"});
  expect_refused({"--out", "/proc"}, {"/proc", "cannot be"});
  expect_refused({"--out", ""}, {"--out"});
}

TEST_F(PlaceBadInputTest, FoldersMadeForTheOutputGoAgain) {
  expect_refused({"--out", file("work/a/b/out"), "--query", "cubus"}, {"cubus"});
}

TEST_F(PlaceBadInputTest, JsonFile) {
  expect_refused({"--json", file("none/x.json")}, {"none/x.json", "cannot be written"});
  expect_refused({"--json", folder()}, {folder().string(), "directory"});
}

TEST_F(PlaceBadInputTest, Arguments) {
  expect_refused({"--speed", "3"}, {"--speed"});
  expect_refused({"cube"}, {"cube"});
  for (const char* count : {"0", "-3", "many", "1e99"}) expect_refused({"--samples", count}, {"--samples", count});
  expect_refused({"--steps", "0"}, {"--steps"});
  expect_refused({"--threads", "0"}, {"--threads"});
  expect_refused({"--seed", "-1"}, {"--seed"});
  expect_refused({"--depth", file("depth.png"), "--cloud", file("c.pcd")}, {"--depth", "--cloud"});
  expect_refused({"--no-image"}, {"--depth", "--cloud"});
  expect_refusal(run_command("dofusion-place", {}), {"dofusion-place", "--help"});
}

class PlaceModelTest : public PlaceBadInputTest {
 protected:
  void SetUp() override {
    PlaceBadInputTest::SetUp();
    config_ = make_config(Preset::kDefault);
    config_.widths = {32, 32};
    config_.embedding = config_.hidden = 32;
    ModelFile model;
    model.config = config_;
    model.parameters = make_network(config_)->initial_parameters(1);
    model.training = "{}";
    write_model(model, file("model.safetensors"));
  }
  void expect_model_refused(const std::string& bytes, const std::vector<std::string>& words) {
    write_file(file("bad.safetensors"), bytes);
    expect_refused({"--model", file("bad.safetensors")}, words);
  }
  ModelConfig config_;
};

TEST_F(PlaceModelTest, DamagedWeights) {
  expect_refused({"--model", file("none.safetensors")}, {"none.safetensors", "no such file"});
  const std::string whole = read_file(file("model.safetensors"));
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, std::size_t{100}, whole.size() / 2, whole.size() - 4}) {
    expect_model_refused(whole.substr(0, size), {"bad.safetensors"});
  }
  expect_model_refused(whole + "more", {"bad.safetensors", "damaged"});
  Rng rng = make_rng(1);
  for (int k = 0; k < 3; ++k) {
    std::string noise(5000, '\0');
    for (char& c : noise) c = static_cast<char>(uniform_int(rng, 0, 255));
    expect_model_refused(noise, {"bad.safetensors", "not a safetensors file"});
  }
  expect_model_refused(std::string(8, '\xff') + whole.substr(8), {"bad.safetensors", "header"});
  expect_model_refused(std::string("\x00\x00\x00\x00\x01\x00\x00\x00", 8) + whole.substr(8), {"bad.safetensors", "header"});
  std::string nan = whole;
  nan.replace(nan.size() - 4, 4, "\xff\xff\xff\xff");
  expect_model_refused(nan, {"bad.safetensors", "not finite"});
}

TEST_F(PlaceModelTest, AnotherArchitecture) {
  const auto with_config = [&](const ModelConfig& config) {
    TensorFile file_of = read_safetensors(file("model.safetensors"));
    file_of.metadata["config"] = to_json(config);
    return to_safetensors(file_of);
  };
  ModelConfig wider = config_;
  wider.widths = {64, 32};
  expect_model_refused(with_config(wider), {"bad.safetensors", "another architecture"});
  ModelConfig deeper = config_;
  deeper.widths = {32, 32, 32};
  expect_model_refused(with_config(deeper), {"bad.safetensors", "another architecture"});
  // The paper's network needs libtorch, which this program does without.
  expect_model_refused(with_config(make_config(Preset::kPaper)), {"bad.safetensors", "paper"});
  TensorFile other = read_safetensors(file("model.safetensors"));
  other.metadata.clear();
  expect_model_refused(to_safetensors(other), {"bad.safetensors", "not a placement model"});
  TensorFile no_json = read_safetensors(file("model.safetensors"));
  no_json.metadata["config"] = "{\"points\": ";
  expect_model_refused(to_safetensors(no_json), {"bad.safetensors", "JSON"});
}

}  // namespace
}  // namespace dofusion
