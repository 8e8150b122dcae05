#include "tests/apps/bop_files.h"

#include <cstdint>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <sstream>

#include <gtest/gtest.h>

namespace dofusion::bop {

namespace fs = std::filesystem;
using nlohmann::json;

std::string six(int number) {
  std::ostringstream text;
  text << std::setw(6) << std::setfill('0') << number;
  return text.str();
}

json read_json(const fs::path& file) {
  std::ifstream stream(file);
  EXPECT_TRUE(stream) << file;
  return json::parse(stream);
}

std::set<std::string> keys(const json& object) {
  std::set<std::string> names;
  for (const auto& [key, value] : object.items()) names.insert(key);
  return names;
}

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

Eigen::Vector3d vector(const json& values) {
  EXPECT_EQ(values.size(), 3u);
  return {values[0].get<double>(), values[1].get<double>(), values[2].get<double>()};
}

Eigen::Matrix3d matrix(const json& values) {
  EXPECT_EQ(values.size(), 9u);
  Eigen::Matrix3d m;
  for (int k = 0; k < 9; ++k) m(k / 3, k % 3) = values[static_cast<std::size_t>(k)].get<double>();
  return m;
}

Model read_ply(const fs::path& file) {
  std::ifstream stream(file);
  std::string line, header;
  std::size_t vertices = 0, faces = 0;
  while (std::getline(stream, line) && line != "end_header") {
    header += line + "\n";
    if (line.rfind("element vertex ", 0) == 0) vertices = std::stoul(line.substr(15));
    if (line.rfind("element face ", 0) == 0) faces = std::stoul(line.substr(13));
  }
  EXPECT_EQ(header.rfind("ply\nformat ascii 1.0\n", 0), 0u) << file;
  EXPECT_NE(header.find("float x\nproperty float y\nproperty float z\nproperty float nx"), std::string::npos);
  Model model;
  for (std::size_t i = 0; i < vertices; ++i) {
    Eigen::Vector3d v, n;
    stream >> v[0] >> v[1] >> v[2] >> n[0] >> n[1] >> n[2];
    model.vertices.push_back(v);
    model.normals.push_back(n);
  }
  for (std::size_t i = 0; i < faces; ++i) {
    int corners = 0;
    std::array<int, 3> t{};
    stream >> corners >> t[0] >> t[1] >> t[2];
    EXPECT_EQ(corners, 3);
    model.triangles.push_back(t);
  }
  EXPECT_FALSE(stream.fail()) << file;
  return model;
}

namespace {

// Undoes LZF: runs of literal bytes, and copies of what came before.
std::string lzf_decoded(const std::string& data) {
  std::string out;
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(data.at(i)); };
  for (std::size_t i = 0; i < data.size();) {
    const std::size_t control = byte(i++);
    if (control < 32) {
      out.append(data, i, control + 1);
      i += control + 1;
      continue;
    }
    std::size_t length = control >> 5;
    if (length == 7) length += byte(i++);
    const std::size_t from = out.size() - ((control & 31) << 8) - byte(i++) - 1;
    for (std::size_t k = 0; k < length + 2; ++k) out.push_back(out.at(from + k));
  }
  return out;
}

}  // namespace

std::vector<float> read_pcd(const fs::path& file, int width, int height) {
  std::ifstream stream(file, std::ios::binary);
  std::string line, header;
  while (std::getline(stream, line)) {
    header += line + "\n";
    if (line.rfind("DATA", 0) == 0) break;
  }
  EXPECT_EQ(line, "DATA binary_compressed");
  EXPECT_NE(header.find("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n"), std::string::npos) << header;
  EXPECT_NE(header.find("WIDTH " + std::to_string(width) + "\nHEIGHT " + std::to_string(height)), std::string::npos)
      << header;
  std::array<std::uint32_t, 2> sizes{};  // packed and not
  stream.read(reinterpret_cast<char*>(sizes.data()), sizeof sizes);
  std::string packed(sizes[0], '\0');
  stream.read(packed.data(), static_cast<std::streamsize>(packed.size()));
  EXPECT_FALSE(stream.fail()) << file;
  const std::string bytes = lzf_decoded(packed);
  EXPECT_EQ(bytes.size(), sizes[1]);
  std::vector<float> values(bytes.size() / sizeof(float));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(float));
  return values;
}

}  // namespace dofusion::bop
