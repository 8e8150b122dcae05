// A small z-buffer for render and compare: thousands of poses of one block a second need neither a tree over its
// twelve triangles nor a whole image. Agrees with the scanner's ray casting, see the test.
#pragma once

#include <cstdint>
#include <vector>

#include "perception/camera.h"
#include "stability/mesh.h"

namespace dofusion {

// The part of the image that a mesh covers.
struct RasterPatch {
  int u0 = 0, v0 = 0;                // pixel of the first entry
  int width = 0, height = 0;         // pixels
  std::vector<float> inverse_depth;  // (height * width) 1/metres, 0 where the mesh is not seen
  std::vector<std::int32_t> face;    // (height * width) triangle, where inverse_depth > 0
  std::vector<float> facing;         // (height * width) cosine of the incidence, taken in the triangle's middle, where
                                     // inverse_depth > 0; elsewhere some number between 0 and 1
};

// Holds the buffers of one thread; what `render` returns lives until the next call.
class DepthRaster {
 public:
  explicit DepthRaster(const Camera& camera) : camera_(camera) {}

  // The mesh's front faces at the pixel centres. Triangles that reach behind the camera are left out.
  const RasterPatch& render(const TriangleMesh& mesh, const Pose& T_camera_object);

  const Camera& camera() const { return camera_; }

 private:
  struct ScreenVertex {
    double u = 0.0, v = 0.0;
    Eigen::Vector3d p_camera;
  };
  bool project_vertices(const TriangleMesh& mesh, const Pose& T_camera_object);
  void fill_triangle(const Eigen::Vector3i& triangle, std::int32_t index);

  Camera camera_;
  RasterPatch patch_;
  std::vector<ScreenVertex> vertices_;
};

}  // namespace dofusion
