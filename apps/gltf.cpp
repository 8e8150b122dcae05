#include "apps/gltf.h"

#include <cmath>
#include <cstring>
#include <stdexcept>

#include <nlohmann/json.hpp>

namespace dofusion {
namespace {

using nlohmann::ordered_json;

// Numbers of the specification (Khronos, glTF 2.0, sections 3.6 and 4.4).
constexpr int kUnsignedByte = 5121, kUnsignedInt = 5125, kFloat = 5126;
constexpr int kVertices = 34962, kIndices = 34963, kNoTarget = 0;
constexpr std::uint32_t kMagic = 0x46546C67, kVersion = 2, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

double linear_of(std::uint8_t srgb) {
  const double c = srgb / 255.0;
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

// 0 … 1 in the shortest text that a picture can tell apart.
double rounded(double value) { return std::round(value * 1e5) / 1e5; }

void append_word(std::string& bytes, std::uint32_t word) {
  for (int k = 0; k < 4; ++k) bytes += static_cast<char>(word >> (8 * k) & 0xff);
}

void append_float(std::string& bytes, double value) {
  const float single = static_cast<float>(value);
  std::uint32_t word = 0;
  std::memcpy(&word, &single, sizeof word);
  append_word(bytes, word);
}

class Writer {
 public:
  explicit Writer(const GltfScene& scene) : scene_(scene) {
    // A quarter turn about x takes z to y; node 0, so that node i of the scene is node i + 1 of the file.
    nodes_.push_back({{"name", "world"}, {"rotation", {-std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5)}}});
  }

  std::string write() {
    for (const GltfMaterial& material : scene_.materials) add(material);
    for (const GltfNode& node : scene_.nodes) add(node);
    for (const GltfAnimation& animation : scene_.animations) add(animation);
    if (scene_.camera) add(*scene_.camera);
    return assembled(document());
  }

 private:
  void add(const GltfMaterial& material) {
    std::vector<double> colour;
    for (const std::uint8_t c : material.colour) colour.push_back(rounded(linear_of(c)));
    colour.push_back(1.0);
    ordered_json json = {
        {"name", material.name},
        {"pbrMetallicRoughness", {{"baseColorFactor", colour}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.9}}}};
    if (!material.lit) {
      json["extensions"]["KHR_materials_unlit"] = ordered_json::object();
      unlit_ = true;
    }
    materials_.push_back(json);
  }

  void add(const GltfNode& node) {
    ordered_json json = {{"name", node.name}};
    place(json, node.T_world_node);
    if (!node.mesh.vertices.empty()) {
      json["mesh"] = meshes_.size();
      meshes_.push_back({{"name", node.name}, {"primitives", primitives(node.mesh)}});
    }
    add_to_world(json);
  }

  void add(const GltfCamera& camera) {
    cameras_.push_back({{"type", "perspective"},
                        {"perspective", {{"aspectRatio", camera.aspect}, {"yfov", camera.fovy}, {"znear", 0.01}}}});
    ordered_json json = {{"name", camera.name}, {"camera", 0}};
    Pose T_world_gltf = camera.T_world_camera;  // glTF's cameras look along −z with y up
    T_world_gltf.linear().col(1) *= -1.0;
    T_world_gltf.linear().col(2) *= -1.0;
    place(json, T_world_gltf);
    add_to_world(json);
  }

  void add(const GltfAnimation& animation) {
    const std::size_t frames = animation.seconds.size();
    if (frames == 0) throw std::invalid_argument("glTF: animation " + animation.name + " has no frame");
    if (animation.nodes.size() != animation.T_world_node.size()) {
      throw std::invalid_argument("glTF: animation " + animation.name + " needs poses for each node");
    }
    const std::size_t start = bytes_.size();
    for (const float t : animation.seconds) append_float(bytes_, t);
    const std::size_t input = accessor("SCALAR", kFloat, frames, view(start, kNoTarget));
    accessors_[input]["min"] = {animation.seconds.front()};
    accessors_[input]["max"] = {animation.seconds.back()};
    ordered_json samplers = ordered_json::array(), channels = ordered_json::array();
    const auto channel = [&](std::size_t node, const char* path, std::size_t output) {
      channels.push_back({{"sampler", samplers.size()}, {"target", {{"node", node + 1}, {"path", path}}}});
      samplers.push_back({{"input", input}, {"interpolation", "LINEAR"}, {"output", output}});
    };
    for (std::size_t k = 0; k < animation.nodes.size(); ++k) {
      if (animation.nodes[k] >= scene_.nodes.size() || animation.T_world_node[k].size() != frames) {
        throw std::invalid_argument("glTF: animation " + animation.name + " does not fit its nodes or times");
      }
      channel(animation.nodes[k], "translation", translations(animation.T_world_node[k]));
      channel(animation.nodes[k], "rotation", rotations(animation.T_world_node[k]));
    }
    animations_.push_back({{"name", animation.name}, {"channels", channels}, {"samplers", samplers}});
  }

  std::size_t translations(const std::vector<Pose>& poses) {
    const std::size_t start = bytes_.size();
    for (const Pose& pose : poses) {
      for (int k = 0; k < 3; ++k) append_float(bytes_, pose.translation()[k]);
    }
    return accessor("VEC3", kFloat, poses.size(), view(start, kNoTarget));
  }

  std::size_t rotations(const std::vector<Pose>& poses) {
    const std::size_t start = bytes_.size();
    Eigen::Quaterniond last = Eigen::Quaterniond::Identity();
    for (const Pose& pose : poses) {
      Eigen::Quaterniond q(pose.linear());
      if (q.dot(last) < 0.0) q.coeffs() *= -1.0;  // the short way from frame to frame
      for (int k = 0; k < 4; ++k) append_float(bytes_, q.coeffs()[k]);
      last = q;
    }
    return accessor("VEC4", kFloat, poses.size(), view(start, kNoTarget));
  }

  ordered_json primitives(const GltfMesh& mesh) {
    ordered_json attributes = {{"POSITION", positions(mesh.vertices)}};
    if (!mesh.colours.empty()) {
      if (mesh.colours.size() != mesh.vertices.size())
        throw std::invalid_argument("glTF: one colour per vertex is needed");
      attributes["COLOR_0"] = colours(mesh.colours);
    }
    ordered_json list = ordered_json::array();
    const auto material = [&](std::size_t index) {
      if (index >= scene_.materials.size())
        throw std::invalid_argument("glTF: there is no material " + std::to_string(index));
      return index;
    };
    if (mesh.faces.empty()) {
      constexpr int kPoints = 0;
      list.push_back({{"attributes", attributes}, {"material", material(mesh.point_material)}, {"mode", kPoints}});
    }
    for (const GltfFaces& faces : mesh.faces) {
      list.push_back({{"attributes", attributes},
                      {"indices", indices(faces.triangles, mesh.vertices.size())},
                      {"material", material(faces.material)}});
    }
    return list;
  }

  std::size_t positions(const std::vector<Eigen::Vector3f>& vertices) {
    const std::size_t start = bytes_.size();
    Eigen::Vector3f low = vertices.front(), high = vertices.front();
    for (const Eigen::Vector3f& v : vertices) {
      low = low.cwiseMin(v);
      high = high.cwiseMax(v);
      for (int k = 0; k < 3; ++k) append_float(bytes_, v[k]);
    }
    const std::size_t result = accessor("VEC3", kFloat, vertices.size(), view(start, kVertices));
    accessors_[result]["min"] = {low.x(), low.y(), low.z()};
    accessors_[result]["max"] = {high.x(), high.y(), high.z()};
    return result;
  }

  // Four bytes each, since elements begin at multiples of four.
  std::size_t colours(const std::vector<std::array<std::uint8_t, 3>>& srgb) {
    const std::size_t start = bytes_.size();
    for (const auto& colour : srgb) {
      for (const std::uint8_t c : colour) bytes_ += static_cast<char>(std::lround(255.0 * linear_of(c)));
      bytes_ += static_cast<char>(255);
    }
    const std::size_t result = accessor("VEC4", kUnsignedByte, srgb.size(), view(start, kVertices));
    accessors_[result]["normalized"] = true;
    return result;
  }

  std::size_t indices(const std::vector<Eigen::Vector3i>& triangles, std::size_t vertices) {
    if (triangles.empty()) throw std::invalid_argument("glTF: faces without a triangle");
    const std::size_t start = bytes_.size();
    for (const Eigen::Vector3i& triangle : triangles) {
      for (int k = 0; k < 3; ++k) {
        if (triangle[k] < 0 || static_cast<std::size_t>(triangle[k]) >= vertices) {
          throw std::invalid_argument("glTF: there is no vertex " + std::to_string(triangle[k]));
        }
        append_word(bytes_, static_cast<std::uint32_t>(triangle[k]));
      }
    }
    return accessor("SCALAR", kUnsignedInt, 3 * triangles.size(), view(start, kIndices));
  }

  // Of the bytes from `start` to the end.
  std::size_t view(std::size_t start, int target) {
    ordered_json json = {{"buffer", 0}, {"byteOffset", start}, {"byteLength", bytes_.size() - start}};
    if (target != kNoTarget) json["target"] = target;
    views_.push_back(json);
    return views_.size() - 1;
  }

  std::size_t accessor(const char* type, int component, std::size_t count, std::size_t buffer_view) {
    accessors_.push_back({{"bufferView", buffer_view}, {"componentType", component}, {"count", count}, {"type", type}});
    return accessors_.size() - 1;
  }

  static void place(ordered_json& node, const Pose& pose) {
    const Eigen::Vector3d& t = pose.translation();
    const Eigen::Quaterniond q(pose.linear());
    node["translation"] = {t.x(), t.y(), t.z()};
    node["rotation"] = {q.x(), q.y(), q.z(), q.w()};
  }

  void add_to_world(const ordered_json& node) {
    nodes_[0]["children"].push_back(nodes_.size());
    nodes_.push_back(node);
  }

  ordered_json document() const {
    ordered_json json = {{"asset", {{"version", "2.0"}, {"generator", "dofusion"}}}, {"scene", 0}};
    json["scenes"].push_back({{"nodes", {0}}});
    if (unlit_) json["extensionsUsed"] = {"KHR_materials_unlit"};
    const std::pair<const char*, const ordered_json*> lists[] = {
        {"nodes", &nodes_},         {"cameras", &cameras_},   {"meshes", &meshes_},        {"materials", &materials_},
        {"accessors", &accessors_}, {"bufferViews", &views_}, {"animations", &animations_}};
    for (const auto& [name, list] : lists) {
      if (!list->empty()) json[name] = *list;  // an empty list is not allowed
    }
    if (!bytes_.empty()) json["buffers"].push_back({{"byteLength", bytes_.size()}});
    return json;
  }

  // Section 4.4: a header, the JSON padded with spaces, the buffer padded with zeros.
  std::string assembled(const ordered_json& json) const {
    // A name need not be UTF-8; JSON must.
    std::string text = json.dump(-1, ' ', false, ordered_json::error_handler_t::replace), buffer = bytes_;
    text.resize((text.size() + 3) / 4 * 4, ' ');
    buffer.resize((buffer.size() + 3) / 4 * 4, '\0');
    std::string file;
    const std::size_t size = 12 + 8 + text.size() + (buffer.empty() ? 0 : 8 + buffer.size());
    for (const std::size_t word :
         {std::size_t{kMagic}, std::size_t{kVersion}, size, text.size(), std::size_t{kJsonChunk}}) {
      append_word(file, static_cast<std::uint32_t>(word));
    }
    file += text;
    if (buffer.empty()) return file;
    append_word(file, static_cast<std::uint32_t>(buffer.size()));
    append_word(file, kBinaryChunk);
    return file + buffer;
  }

  const GltfScene& scene_;
  ordered_json nodes_, cameras_, meshes_, materials_, accessors_, views_, animations_;  // lists, or null while empty
  bool unlit_ = false;
  std::string bytes_;  // the binary buffer; every part is a multiple of four long
};

}  // namespace

std::string to_glb(const GltfScene& scene) { return Writer(scene).write(); }

}  // namespace dofusion
