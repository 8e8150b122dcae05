// Scenes as glTF 2.0 binaries (.glb), which any viewer opens: rigid bodies, points, cameras and motions.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "stability/pose.h"

namespace dofusion {

struct GltfMaterial {
  std::string name;
  std::array<std::uint8_t, 3> colour{200, 200, 200};  // sRGB; the file's are linear
  bool lit = true;                                    // otherwise KHR_materials_unlit: the colour as it is
};

struct GltfFaces {
  std::vector<Eigen::Vector3i> triangles;  // (T) indices into the mesh's vertices, counter-clockwise from outside
  std::size_t material = 0;
};

// Triangles without normals, which viewers shade flat; or, without faces, points.
struct GltfMesh {
  std::vector<Eigen::Vector3f> vertices;             // (V) metres
  std::vector<std::array<std::uint8_t, 3>> colours;  // (V) of points, sRGB; empty: the material's
  std::vector<GltfFaces> faces;                      // one per material
  std::size_t point_material = 0;                    // of points
};

struct GltfNode {
  std::string name;
  Pose T_world_node = Pose::Identity();
  GltfMesh mesh;  // no vertices: a frame alone
};

struct GltfCamera {
  std::string name;
  Pose T_world_camera = Pose::Identity();  // OpenCV's frame: x right, y down, z forward
  double fovy = 0.8, aspect = 4.0 / 3.0;   // radians; width / height
};

// How nodes move: `T_world_node[k]` holds the pose at every one of `seconds` of node nodes[k].
struct GltfAnimation {
  std::string name;
  std::vector<float> seconds;                   // (F) ascending
  std::vector<std::size_t> nodes;               // (K)
  std::vector<std::vector<Pose>> T_world_node;  // (K, F)
};

struct GltfScene {
  std::vector<GltfMaterial> materials;
  std::vector<GltfNode> nodes;
  std::vector<GltfAnimation> animations;
  std::optional<GltfCamera> camera;
};

// The file's bytes; the same scene gives the same bytes. The world's z points up, glTF's y: a node "world" above all
// others turns it. Throws std::invalid_argument if an index or a length does not fit, or if an animation has no frame.
std::string to_glb(const GltfScene& scene);

}  // namespace dofusion
