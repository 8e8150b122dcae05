// How the faces of a depth image meet: where they are continuous, and whether the edge is convex.
#pragma once

#include <vector>

#include "perception/faces.h"

namespace dofusion {

struct FaceEdge {
  int a = 0, b = 0;           // faces, a < b
  int length = 0;             // pixel pairs along the common border in the image
  int continuous = 0;         // of these, pairs where both planes meet at the border: no step in depth
  double angle_deg = 0.0;     // between the normals
  double convexity = 0.0;     // summed over the border; positive: convex (a ridge), negative: concave (a groove)
  int compared = 0;           // pairs whose readings a little off the border were compared
  double plane_step = 0.0;    // mean step between the two planes at the border, sigmas
  double reading_step = 0.0;  // mean step between the readings on both sides, less the common slope, sigmas
};

// Borders between faces that are at most `max_gap_px` apart along a row or a column.
std::vector<FaceEdge> find_face_edges(const FaceMap& map, const DepthImage& depth, const Camera& camera,
                                      const FaceOptions& options, int max_gap_px = 3);

// One curved surface explains the readings of both faces better than their two planes do: a bend, not an edge. The
// surface is quadratic in the image, which has as many parameters as the two planes.
bool is_bend(const FaceMap& map, int f, int g, const DepthImage& depth, const Camera& camera,
             const FaceOptions& options);

// How the readings of face g lie to the plane of face f.
struct FaceRelation {
  double in_front =
      0.0;            // share of g's readings before f's plane, beyond noise: f and g are not faces of one convex body
  double rms = 0.0;   // of g's readings about f's plane, in standard deviations of reading and extrapolation
  double blur = 0.0;  // mean standard deviation of f's plane at g's readings, in sigmas of a reading
};

// relation[f][g] for all faces.
std::vector<std::vector<FaceRelation>> relate_faces(const FaceMap& map, const DepthImage& depth, const Camera& camera,
                                                    const FaceOptions& options);

}  // namespace dofusion
