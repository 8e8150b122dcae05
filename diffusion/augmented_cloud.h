// The paper's augmented cloud, equation (4): points on every object with the signed distance to all other objects
// merged and a flag for the object that is being placed; beside them the directions of surface and distance.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "stability/random.h"
#include "stability/scene.h"
#include "stability/sdf.h"
#include "stability/sharp_features.h"

namespace dofusion {

// The normalised length of a scene: the cube root of the geometric mean of its objects' volumes, query included. Every
// length that the network sees is in this unit, so that 3 cm blocks and 30 cm boxes are the same problem. Throws
// std::invalid_argument if there is no object or a volume is not positive.
double normalised_length(const std::vector<double>& volumes);

// What a cloud says of each point, in this order: position, signed distance to the other objects merged, 1 on the query
// and else 0 (these five are the paper's); outward unit normal of the point's own surface; unit vector along which the
// distance to the others grows (zero without others). On edges and corners the surface's normal is zero.
inline constexpr int kCloudChannels = 11;

// x, y and z of some points apart, each an array.
using Columns = std::array<float*, 3>;
using ConstColumns = std::array<const float*, 3>;

// An object prepared for clouds: float triangles to draw points from and to measure distances to.
class CloudShape {
 public:
  explicit CloudShape(const Object& object);
  // The same from a convex closed mesh, without an Object; `box_edges` if it is that box.
  CloudShape(const TriangleMesh& mesh, const std::optional<Eigen::Vector3d>& box_edges);

  double volume() const { return volume_; }

  // `count` points and their outward unit normals; own frame, metres. Of these the share `sharp` lies on sharp edges,
  // if the object has any: each corner once (or, where they are more, drawn from them), then points uniform along the
  // edges; all without a normal. The others are uniform over the surface.
  void sample(int count, double sharp, Rng& rng, const Columns& point, const Columns& normal) const;

  // Signed distance of each point (own frame, metres) and the unit vector along which it grows. Exact outside; inside
  // a solid of several convex parts it is that of the part that the point is deepest in. From the object's grid if it
  // has one.
  void signed_distance(int count, const ConstColumns& point, float* distance, const Columns& direction) const;

 private:
  struct Triangle {
    Eigen::Vector3f a, ab, ac, normal;                // normal: unit
    Eigen::Vector3f edge_start[3], edge[3], side[3];  // side: in the plane, pointing out of the triangle
    float edge_inverse_square[3];
  };
  using Triangles = std::vector<Triangle>;
  static Triangles prepare(const TriangleMesh& mesh);
  void set_surface(const TriangleMesh& mesh);
  Eigen::Vector3f surface_point(Rng& rng, Eigen::Vector3f& normal) const;
  Eigen::Vector3f edge_point(Rng& rng) const;
  void box_distance(int count, const ConstColumns& point, float* distance, const Columns& direction) const;
  void field_distance(int count, const ConstColumns& point, float* distance, const Columns& direction) const;
  static void convex_distance(const Triangles& triangles, int count, const ConstColumns& point, float* distance,
                              const Columns& direction);

  Triangles surface_;
  std::vector<float> cumulative_area_;  // of surface_
  SharpFeatures sharp_;
  std::vector<float> cumulative_length_;  // of its edges
  std::optional<Eigen::Vector3f> half_edges_;
  std::vector<Triangles> parts_;  // convex solids that make up the object
  DistanceFunction field_;        // of an object's grid, or of a solid without convex parts; else empty
  double volume_ = 0.0;
};

using CloudShapePtr = std::shared_ptr<const CloudShape>;

struct CloudOptions {
  int points = 192;             // of the whole cloud
  int query_points = 0;         // of these, on the query; 0: all objects get equal shares, the query the remainder
  double sharp_share = 0.0;     // of each object's points, on its edges and corners
  double length = 1.0;          // metres in the normalised length
  double distance_limit = 1.0;  // normalised: the SDF channel is clamped to +- this, and is this without others
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // world position that becomes 0, metres
};

// Fills cloud (points, kCloudChannels), lengths normalised, axes of the world. Points are drawn afresh; alone, the
// query has them all. T_world_object: one pose per shape, metres. Throws std::invalid_argument if an object gets no
// point.
void make_augmented_cloud(const std::vector<CloudShapePtr>& shapes, const std::vector<Pose>& T_world_object, int query,
                          const CloudOptions& options, Rng& rng, float* cloud);

}  // namespace dofusion
