// How a mesh's triangles hang together. Vertices are compared by position, so that a mesh with one vertex per corner
// and face, as STL has, counts as joined.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "stability/mesh.h"

namespace dofusion {

// For every vertex the first vertex at the same position.
std::vector<int> position_ids(const TriangleMesh& mesh);

// One side of a triangle, as a directed edge between two of the ids of position_ids.
struct HalfEdge {
  int low = 0, high = 0;  // the ids, low <= high
  int triangle = 0;
  bool forward = true;  // the triangle runs from low to high
};

// Those of all triangles, ordered by edge and then by triangle: the half edges of one edge are neighbours. O(n).
std::vector<HalfEdge> half_edges(const TriangleMesh& mesh, const std::vector<int>& ids);

struct EdgeFault {
  std::size_t count = 0;                                                         // edges that have it
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();  // the first of them
  int triangles = 0;                                                             // that share the first
};

// Why a surface bounds no solid. A closed one has none of these; four triangles may share an edge, as where two boxes
// touch along it, if they run through it as often in either direction.
struct SurfaceFaults {
  EdgeFault open;          // one triangle only: a hole
  EdgeFault odd;           // three, five, … triangles: an inner wall, or a triangle that is there twice
  EdgeFault unbalanced;    // an even number, not as many in one direction as in the other: triangles are flipped
  std::size_t points = 0;  // triangles with two corners at one position
  bool none() const { return open.count + odd.count + unbalanced.count + points == 0; }
};
SurfaceFaults surface_faults(const TriangleMesh& mesh);

// The shell that each triangle belongs to, from 0: triangles are joined over edges that exactly two of them share.
struct Shells {
  std::vector<int> of_triangle;
  int count = 0;
};

// Turns triangles so that neighbours over an edge of exactly two agree; the first triangle of each shell stays. The
// result says which shells were touched. nullopt if that cannot be done: the surface is one-sided, as Klein's bottle.
struct ConsistentWinding {
  TriangleMesh mesh;
  Shells shells;
  std::vector<bool> touched;  // per shell
};
std::optional<ConsistentWinding> wound_consistently(const TriangleMesh& mesh);

// Turns shells that are inside out, of a closed mesh that is wound consistently. A shell inside another is the wall
// of a cavity if it points inwards, and stays; those in `touched` point inwards there and outwards elsewhere. A mesh
// whose volume is negative is turned as a whole first. Throws std::invalid_argument if more than 1000 shells would have
// to be looked at.
TriangleMesh with_outward_shells(const ConsistentWinding& wound);

// Keeps the first of triangles that are there more than once, in the same direction and at the same place.
TriangleMesh without_repeated_triangles(const TriangleMesh& mesh);

}  // namespace dofusion
