// The glTF binary: by the specification's own words, and as assimp reads it back.
#include "apps/gltf.h"

#include <cmath>
#include <cstring>

#include <assimp/Importer.hpp>
#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace dofusion {
namespace {

using nlohmann::json;

constexpr double kSingle = 1e-6;  // metres: what single precision leaves of a metre, ten times over

std::uint32_t word(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);  // the file and the machines here are little-endian
  return value;
}

float real(const std::string& bytes, std::size_t at) {
  float value = 0.0f;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// A tetrahedron that turns once about z while it moves along x, and two points.
GltfScene turning_tetrahedron() {
  GltfScene scene;
  scene.materials = {{"seen", {188, 0, 255}, true}, {"unseen", {10, 20, 30}, true}, {"points", {255, 255, 255}, false}};
  GltfNode body{"body", make_pose(so3_exp({0.0, 0.0, 0.3}), {0.1, 0.2, 0.3}), {}};
  body.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 2}};
  body.mesh.faces = {{{{0, 2, 1}, {0, 1, 3}}, 0}, {{{0, 3, 2}, {1, 2, 3}}, 1}};
  GltfNode cloud{"cloud", Pose::Identity(), {}};
  cloud.mesh.vertices = {{0, 0, 1}, {2, 0, 1}};
  cloud.mesh.colours = {{255, 0, 0}, {0, 188, 0}};
  cloud.mesh.point_material = 2;
  scene.nodes = {body, cloud};
  GltfAnimation motion{"turn", {}, {0}, {{}}};
  for (int k = 0; k <= 12; ++k) {
    motion.seconds.push_back(static_cast<float>(k) / 25.0f);
    motion.T_world_node[0].push_back(make_pose(so3_exp({0.0, 0.0, k * M_PI / 6.0}), {0.01 * k, 0.0, 0.5}));
  }
  scene.animations = {motion};
  scene.camera = GltfCamera{"camera", Pose::Identity(), 0.7, 1.5};
  return scene;
}

struct Glb {
  json document;
  std::string buffer;
};

Glb parsed(const std::string& file) {
  Glb glb;
  EXPECT_EQ(file.substr(0, 4), "glTF");
  EXPECT_EQ(word(file, 4), 2u);
  EXPECT_EQ(word(file, 8), file.size());
  const std::size_t text = word(file, 12);
  EXPECT_EQ(text % 4, 0u);
  EXPECT_EQ(file.substr(16, 4), "JSON");
  glb.document = json::parse(file.substr(20, text));
  const std::size_t at = 20 + text;
  EXPECT_EQ(word(file, at) % 4, 0u);
  EXPECT_EQ(file.substr(at + 4, 4), std::string("BIN\0", 4));
  glb.buffer = file.substr(at + 8);
  EXPECT_EQ(word(file, at), glb.buffer.size());
  return glb;
}

std::size_t offset_of(const Glb& glb, std::size_t accessor) {
  const std::size_t view = glb.document.at("accessors").at(accessor).at("bufferView");
  return glb.document.at("bufferViews").at(view).at("byteOffset");
}

TEST(Gltf, EveryAccessorFillsItsPieceOfTheBuffer) {
  const Glb glb = parsed(to_glb(turning_tetrahedron()));
  EXPECT_EQ(glb.document.at("asset").at("version"), "2.0");
  EXPECT_EQ(glb.document.at("buffers").at(0).at("byteLength"), glb.buffer.size());
  const std::map<std::string, std::size_t> width = {{"SCALAR", 1}, {"VEC3", 3}, {"VEC4", 4}};
  std::size_t end = 0;
  for (const json& accessor : glb.document.at("accessors")) {
    const json& view = glb.document.at("bufferViews").at(accessor.at("bufferView").get<std::size_t>());
    const std::size_t component = accessor.at("componentType") == 5121 ? 1 : 4;
    EXPECT_EQ(view.at("byteLength").get<std::size_t>(),
              accessor.at("count").get<std::size_t>() * width.at(accessor.at("type")) * component);
    EXPECT_EQ(view.at("byteOffset").get<std::size_t>(), end);  // neither gaps nor overlaps, and aligned
    EXPECT_EQ(end % 4, 0u);
    end += view.at("byteLength").get<std::size_t>();
  }
  EXPECT_EQ(end, glb.buffer.size());
}

TEST(Gltf, PositionsHaveTheirBoundsAndColoursAreLinear) {
  const Glb glb = parsed(to_glb(turning_tetrahedron()));
  const json& body = glb.document.at("meshes").at(0);
  ASSERT_EQ(body.at("primitives").size(), 2u);  // one per material, with the same vertices
  const std::size_t positions = body.at("primitives").at(0).at("attributes").at("POSITION");
  EXPECT_EQ(body.at("primitives").at(1).at("attributes").at("POSITION").get<std::size_t>(), positions);
  EXPECT_EQ(glb.document.at("accessors").at(positions).at("min"), json({0.0, 0.0, 0.0}));
  EXPECT_EQ(glb.document.at("accessors").at(positions).at("max"), json({1.0, 1.0, 2.0}));
  // The sRGB standard's half: 188 of 255 is 0.5029 of the light.
  const json& colour = glb.document.at("materials").at(0).at("pbrMetallicRoughness").at("baseColorFactor");
  EXPECT_NEAR(colour.at(0).get<double>(), 0.5029, 1e-4);
  EXPECT_EQ(colour.at(1).get<double>(), 0.0);
  EXPECT_EQ(colour.at(2).get<double>(), 1.0);
  const json& points = glb.document.at("meshes").at(1).at("primitives").at(0);
  EXPECT_EQ(points.at("mode"), 0);
  const std::size_t colours = offset_of(glb, points.at("attributes").at("COLOR_0"));
  EXPECT_EQ(glb.buffer.substr(colours, 8), std::string("\xff\0\0\xff\0\x80\0\xff", 8));  // 0.5029 · 255 = 128
}

TEST(Gltf, MotionIsSampledAtItsTimesTheShortWayRound) {
  const Glb glb = parsed(to_glb(turning_tetrahedron()));
  const json& motion = glb.document.at("animations").at(0);
  ASSERT_EQ(motion.at("channels").size(), 2u);
  std::map<std::string, std::size_t> output;
  for (const json& channel : motion.at("channels")) {
    EXPECT_EQ(glb.document.at("nodes").at(channel.at("target").at("node").get<std::size_t>()).at("name"), "body");
    const json& sampler = motion.at("samplers").at(channel.at("sampler").get<std::size_t>());
    const json& input = glb.document.at("accessors").at(sampler.at("input").get<std::size_t>());
    EXPECT_EQ(input.at("count"), 13);
    EXPECT_EQ(input.at("min").at(0), 0.0);
    EXPECT_NEAR(input.at("max").at(0).get<double>(), 12.0 / 25.0, kSingle);
    output[channel.at("target").at("path")] = sampler.at("output");
    EXPECT_EQ(glb.document.at("accessors").at(sampler.at("output").get<std::size_t>()).at("count"), 13);
  }
  const std::size_t turns = offset_of(glb, output.at("rotation")), shifts = offset_of(glb, output.at("translation"));
  for (std::size_t k = 0; k < 13; ++k) {
    EXPECT_NEAR(real(glb.buffer, shifts + 12 * k), 0.01 * static_cast<double>(k), kSingle);
    // A whole turn ends at the quaternion −1, not at +1: there is no jump back on the way.
    EXPECT_NEAR(real(glb.buffer, turns + 16 * k + 8), std::sin(k * M_PI / 12.0), kSingle);
    EXPECT_NEAR(real(glb.buffer, turns + 16 * k + 12), std::cos(k * M_PI / 12.0), kSingle);
  }
}

aiVector3D in_world(const aiNode* node, aiVector3D p) {
  for (; node != nullptr; node = node->mParent) p = node->mTransformation * p;
  return p;
}

TEST(Gltf, AssimpReadsWhatWasWrittenWithYUp) {
  const GltfScene written = turning_tetrahedron();
  const std::string file = to_glb(written);
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFileFromMemory(file.data(), file.size(), 0, "glb");
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  const aiNode* body = scene->mRootNode->FindNode("body");
  ASSERT_NE(body, nullptr);
  ASSERT_EQ(body->mNumMeshes, 2u);
  const aiMesh* seen = scene->mMeshes[body->mMeshes[0]];
  ASSERT_EQ(seen->mNumFaces, 2u);
  // The tip (0, 0, 2) stands over the node's origin (0.1, 0.2, 0.3): z becomes y, y becomes −z.
  double highest = -1.0;
  for (unsigned f = 0; f < seen->mNumFaces; ++f) {
    for (unsigned k = 0; k < 3; ++k) {
      const aiVector3D p = in_world(body, seen->mVertices[seen->mFaces[f].mIndices[k]]);
      if (p.y <= highest) continue;
      highest = p.y;
      EXPECT_TRUE(p.y < 2.0 || (std::abs(p.x - 0.1) < 1e-5 && std::abs(p.z + 0.2) < 1e-5)) << p.x << " " << p.z;
    }
  }
  EXPECT_NEAR(highest, 2.3, 1e-5);
  ASSERT_EQ(scene->mNumAnimations, 1u);
  ASSERT_EQ(scene->mAnimations[0]->mNumChannels, 1u);  // assimp has one for both of a node's paths
  const aiNodeAnim* channel = scene->mAnimations[0]->mChannels[0];
  EXPECT_EQ(channel->mNumPositionKeys, 13u);
  EXPECT_EQ(channel->mNumRotationKeys, 13u);
  EXPECT_NEAR(channel->mPositionKeys[12].mValue.x, 0.12, kSingle);
  ASSERT_EQ(scene->mNumCameras, 1u);
  const aiNode* camera = scene->mRootNode->FindNode("camera");
  ASSERT_NE(camera, nullptr);
  // The camera looks along its −z. OpenCV's looked along the world's z, which is up in the file.
  EXPECT_NEAR(in_world(camera, {0, 0, -1}).y, 1.0, 1e-5);
}

TEST(Gltf, WhatDoesNotFitIsRefused) {
  EXPECT_EQ(to_glb(turning_tetrahedron()), to_glb(turning_tetrahedron()));
  EXPECT_NO_THROW(to_glb({}));
  GltfScene scene = turning_tetrahedron();
  scene.nodes[0].mesh.faces[0].material = 3;
  EXPECT_THROW(to_glb(scene), std::invalid_argument);
  scene = turning_tetrahedron();
  scene.nodes[0].mesh.faces[0].triangles[0] = {0, 1, 4};
  EXPECT_THROW(to_glb(scene), std::invalid_argument);
  scene = turning_tetrahedron();
  scene.nodes[1].mesh.colours.pop_back();
  EXPECT_THROW(to_glb(scene), std::invalid_argument);
  scene = turning_tetrahedron();
  scene.animations[0].T_world_node[0].pop_back();
  EXPECT_THROW(to_glb(scene), std::invalid_argument);
  scene.animations[0] = {"empty", {}, {}, {}};
  EXPECT_THROW(to_glb(scene), std::invalid_argument);
}

}  // namespace
}  // namespace dofusion
