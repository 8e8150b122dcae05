// Pieces of a solid cut by planes across the axes, each with its volume and its convex hull: the ground that
// stability/convex_parts.h stands on. The solid itself is never meshed anew.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "stability/mesh.h"
#include "stability/mesh_rays.h"

namespace dofusion {

// Convex polygons on the surface, with the triangle that each was cut from.
struct SurfacePieces {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> start = {0};  // polygon i has the points [start[i], start[i + 1])
  std::vector<int> triangle;
  int size() const { return static_cast<int>(triangle.size()); }
};

// The solid within a box. Its hull is that of the surface within the box and of the box's corners inside the solid: any
// other point of the solid in the box lies between two of its points.
struct SolidCell {
  SurfacePieces surface;
  Eigen::AlignedBox3d box;
  double volume = 0.0;
  TriangleMesh hull;  // empty if the surface in the box is flat: then there is no solid in it
  double hull_volume = 0.0;
  double excess() const { return hull_volume - volume; }
};

// A plane across an axis.
struct Cut {
  int axis = 0;
  double at = 0.0;
  double volume_below = 0.0, section = 0.0;  // of the solid in the cell: m3 below the plane, m2 in it
  double cost = 0.0;                         // estimated from a part of the points
};

struct CellPair {
  SolidCell below, above;
};

class CellSplitter {
 public:
  // `worse_side_weight`: what the excess of the worse side of a cut counts beside the hulls of both. At 0 the next cut
  // alone is looked at, and a ring is cut into thin slices; at 1 halves that come apart well later are preferred.
  CellSplitter(const TriangleMesh& closed_mesh, double worse_side_weight);

  // Metres; a hull's corners may lie so far outside it.
  double flatness() const { return 1e-6 * size_; }

  SolidCell whole() const;

  // Cut where the hulls of the two sides are smallest, of a set of even cuts and of those along the solid's own faces.
  // nullopt if the cell is too thin to be cut.
  std::optional<CellPair> split(const SolidCell& cell) const;

 private:
  double cost_of(const SolidCell& cell, const Cut& cut, double hull_below, double hull_above) const;
  std::vector<double> candidates(const SolidCell& cell, int axis) const;
  std::optional<Cut> best_cut_across(const SolidCell& cell, int axis) const;
  CellPair split_at(const SolidCell& cell, const Cut& cut) const;
  void add_inner_corners(const Eigen::AlignedBox3d& box, std::vector<Eigen::Vector3d>& points) const;
  void find_hull(SolidCell& cell) const;

  double worse_side_weight_;
  TriangleMesh mesh_;
  std::vector<Eigen::Vector3d> normals_;  // of the triangles, unit
  MeshRays rays_;
  double size_ = 0.0;  // the bounding box's diagonal
};

}  // namespace dofusion
