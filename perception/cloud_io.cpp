#include "perception/cloud_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <vector>

#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>
#include <pcl/point_types.h>

#include "perception/pcl_conversions.h"
#include "stability/child_process.h"
#include "stability/files.h"

namespace dofusion {
namespace {

using Words = std::vector<std::string>;

// A number of digits alone; none if it is something else or beyond 1e15.
std::optional<std::uint64_t> whole_number(const std::string& word) {
  if (word.empty() || word.size() > 15 || word.find_first_not_of("0123456789") != std::string::npos)
    return std::nullopt;
  return std::stoull(word);
}

// Bytes of one point; none if the lines on its fields do not fit one another.
std::optional<std::uint64_t> point_bytes(const Words& fields, const Words& sizes, const Words& types,
                                         const Words& counts) {
  if (fields.empty() || fields.size() > 100 || sizes.size() != fields.size() || types.size() != fields.size())
    return std::nullopt;
  if (!counts.empty() && counts.size() != fields.size()) return std::nullopt;
  std::uint64_t bytes = 0;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const auto size = whole_number(sizes[i]), count = counts.empty() ? 1 : whole_number(counts[i]);
    const bool known = types[i] == "F" ? size == 4 || size == 8 : types[i] == "I" || types[i] == "U";
    if (!known || !(size == 1 || size == 2 || size == 4 || size == 8) || !count || *count < 1 || *count > 100000)
      return std::nullopt;
    bytes += *size * *count;
  }
  return bytes;
}

// PCL's readers trust a header: memory is taken for as many points as promised, and damaged files crash them (a PLY's
// list among its vertices) or keep them for ever. So a child process reads, after a look at the header.
// True if the header makes sense and its points have room in the file.
bool has_sane_pcd_header(const std::string& path) {
  constexpr int kMostLines = 200;
  constexpr std::uint64_t kBestCompression = 100;  // LZF writes 264 bytes with 3
  static const std::set<std::string> names = {"VERSION", "FIELDS", "COLUMNS",   "SIZE",   "TYPE", "COUNT",
                                              "WIDTH",   "HEIGHT", "VIEWPOINT", "POINTS", "DATA"};
  std::ifstream in(path, std::ios::binary);
  std::map<std::string, Words> header;
  std::string line;
  for (int k = 0; k < kMostLines && header.count("DATA") == 0 && std::getline(in, line); ++k) {
    std::istringstream words(line);
    std::string name;
    if (!(words >> name) || name.front() == '#') continue;
    if (names.count(name) == 0) return false;
    const Words values{std::istream_iterator<std::string>(words), {}};
    if (!header.emplace(name, values).second) return false;  // it stood there already
  }
  const auto bytes = point_bytes(header["FIELDS"], header["SIZE"], header["TYPE"], header["COUNT"]);
  for (const char* name : {"WIDTH", "HEIGHT", "POINTS", "DATA"}) {
    if (header[name].size() != 1) return false;
  }
  const auto width = whole_number(header["WIDTH"][0]), height = whole_number(header["HEIGHT"][0]);
  const auto points = whole_number(header["POINTS"][0]);
  if (!bytes || !width || !height || !points || *width > 1000000000 || *height > 1000000 ||
      *width * *height != *points || *points == 0)
    return false;
  const std::uint64_t file_bytes = std::filesystem::file_size(path);
  const std::string& data = header["DATA"][0];
  if (data == "ascii") return 2 * *points <= file_bytes;  // a digit and the end of the line
  if (data == "binary") return *points <= file_bytes / *bytes;
  if (data != "binary_compressed" || *points > kBestCompression * file_bytes / *bytes) return false;
  std::uint32_t packed = 0, unpacked = 0;  // little endian, as all the machines that PCL writes on
  in.read(reinterpret_cast<char*>(&packed), sizeof packed).read(reinterpret_cast<char*>(&unpacked), sizeof unpacked);
  return in && unpacked == *points * *bytes && packed <= file_bytes;
}

// As above for a PLY: every element takes a byte at least, and there are vertices.
bool has_sane_ply_header(const std::string& path) {
  constexpr int kMostLines = 1000;
  const std::uint64_t file_bytes = std::filesystem::file_size(path);
  std::ifstream in(path, std::ios::binary);
  std::string line;
  bool any = false;
  for (int k = 0; k < kMostLines && std::getline(in, line); ++k) {
    std::istringstream words(line);
    std::string keyword, name, count;
    words >> keyword >> name >> count;
    if (keyword == "end_header") return any;
    if (keyword != "element") continue;
    const std::uint64_t elements = whole_number(count).value_or(file_bytes + 1);
    if (elements > file_bytes) return false;
    any = any || (name == "vertex" && elements > 0);
  }
  return false;
}

// The header's numbers, then x, y, z of every point.
struct PackedHeader {
  std::uint32_t width = 0, height = 0, is_dense = 0;
};
using PackedPoint = std::array<float, 3>;

std::string packed(const Cloud& cloud) {
  const PackedHeader header{cloud.width, cloud.height, cloud.is_dense ? 1U : 0U};
  std::vector<PackedPoint> points;
  for (const pcl::PointXYZ& p : cloud) points.push_back({p.x, p.y, p.z});
  return std::string(reinterpret_cast<const char*>(&header), sizeof header) +
         std::string(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(PackedPoint));
}

// Empty if the bytes are not those of a cloud.
Cloud unpacked(const std::string& bytes) {
  PackedHeader header;
  if (bytes.size() < sizeof header) return {};
  std::memcpy(&header, bytes.data(), sizeof header);
  const std::size_t count = (bytes.size() - sizeof header) / sizeof(PackedPoint);
  if (std::uint64_t{header.width} * header.height != count || count == 0) return {};
  Cloud cloud(header.width, header.height);
  cloud.is_dense = header.is_dense != 0;
  for (std::size_t i = 0; i < count; ++i) {
    PackedPoint p;
    std::memcpy(p.data(), bytes.data() + sizeof header + i * sizeof p, sizeof p);
    cloud[i] = {p[0], p[1], p[2]};
  }
  return cloud;
}

constexpr int kRead = 0, kRefused = 3;  // exit statuses of the child

int read_in_child(const std::string& path, bool is_pcd, int pipe) {
  Cloud cloud;
  try {
    const int status = is_pcd ? pcl::PCDReader().read(path, cloud) : pcl::PLYReader().read(path, cloud);
    return status >= 0 && !cloud.empty() && write_all(pipe, packed(cloud)) ? kRead : kRefused;
  } catch (const std::exception&) {
    return kRefused;  // PCL throws on some damaged headers and returns a status on others
  }
}

}  // namespace

Cloud read_cloud(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path + ": no such cloud file");
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), ::tolower);
  const bool is_pcd = extension == ".pcd";
  if (!is_pcd && extension != ".ply") throw InputError(path + ": a cloud must be a .pcd or .ply file");
  Cloud cloud;
  if (is_pcd ? has_sane_pcd_header(path) : has_sane_ply_header(path)) {
    const ChildResult child = run_in_child([&](int pipe) { return read_in_child(path, is_pcd, pipe); },
                                           reading_seconds(static_cast<double>(std::filesystem::file_size(path))));
    if (child.end == ChildResult::End::kReturned && child.status == kRead) cloud = unpacked(child.output);
  }
  if (cloud.empty()) throw InputError(path + ": damaged, or without points");
  return cloud;
}

DepthImage read_cloud_as_depth(const std::string& path, const Camera& camera) {
  DepthImage depth(camera.width, camera.height, 0.0F);
  bool any = false;
  for (const pcl::PointXYZ& p : read_cloud(path)) {
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z) || p.z <= 0.0F) continue;
    const Eigen::Vector2d pixel = project(camera, {p.x, p.y, p.z});
    if (!(pixel.cwiseAbs().maxCoeff() < 1e6)) continue;
    const int column = static_cast<int>(std::lround(pixel.x())), row = static_cast<int>(std::lround(pixel.y()));
    if (!depth.contains(row, column)) continue;
    float& reading = depth.at(row, column);
    if (reading == 0.0F || p.z < reading) reading = p.z;
    any = true;
  }
  if (!any) {
    throw InputError(path +
                     ": no point projects into the camera's image; the cloud must be in the camera's frame (x "
                     "right, y down, z forward, metres)");
  }
  return depth;
}

}  // namespace dofusion
