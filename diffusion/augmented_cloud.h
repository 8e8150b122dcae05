// The paper's augmented cloud, equation (4): points on every object with the signed distance to all other objects
// merged and a flag for the object that is being placed.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "stability/random.h"
#include "stability/scene.h"
#include "stability/sdf.h"

namespace dofusion {

// The normalised length of a scene: the cube root of the geometric mean of its objects' volumes, query included. Every
// length that the network sees is in this unit, so that 3 cm blocks and 30 cm boxes are the same problem. Throws
// std::invalid_argument if there is no object or a volume is not positive.
double normalised_length(const std::vector<double>& volumes);

// An object prepared for clouds: float triangles to draw points from and to measure distances to.
class CloudShape {
 public:
  explicit CloudShape(const Object& object);
  // The same from a convex closed mesh, without an Object; `box_edges` if it is that box.
  CloudShape(const TriangleMesh& mesh, const std::optional<Eigen::Vector3d>& box_edges);

  double volume() const { return volume_; }

  // `count` points, uniform over the surface, own frame, metres: x, y, z apart, each (count).
  void sample(int count, Rng& rng, float* x, float* y, float* z) const;

  // out[i] = min(out[i], signed distance of point i), metres. Exact, or from the object's grid; points (count) in this object's frame.
  void min_distance(int count, const float* x, const float* y, const float* z, float* out) const;

 private:
  struct Triangle {
    Eigen::Vector3f a, ab, ac, normal;                // normal: unit
    Eigen::Vector3f edge_start[3], edge[3], side[3];  // side: in the plane, pointing out of the triangle
    float edge_inverse_square[3];
  };
  void prepare(const TriangleMesh& mesh);

  std::vector<Triangle> triangles_;
  std::vector<float> cumulative_area_;
  std::optional<Eigen::Vector3f> half_edges_;
  DistanceFunction distance_;  // of an object's grid, or of a solid that is not convex; else empty
  double volume_ = 0.0;
};

using CloudShapePtr = std::shared_ptr<const CloudShape>;

struct CloudOptions {
  int points = 192;             // shared out among the objects, the remainder to the query
  double length = 1.0;          // metres in the normalised length
  double distance_limit = 1.0;  // normalised: the SDF channel is clamped to +- this, and is this without others
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // world position that becomes 0, metres
};

// Fills cloud (points, 5): x, y, z, SDF, flag (1: query), lengths normalised, axes of the world. Points are drawn
// afresh. T_world_object: one pose per shape, metres.
void make_augmented_cloud(const std::vector<CloudShapePtr>& shapes, const std::vector<Pose>& T_world_object, int query,
                          const CloudOptions& options, Rng& rng, float* cloud);

}  // namespace dofusion
