// Mesh files: anything that assimp reads in, Wavefront OBJ out.
#pragma once

#include <cstddef>
#include <string>

#include "stability/mesh.h"

namespace dofusion {

inline constexpr std::size_t kMostFileTriangles = 5000000;

// Reads OBJ, STL, PLY, … ; coordinates are multiplied by `unit` to give metres. All parts of the file are merged,
// polygons triangulated, equal vertices welded. Throws InputError naming the file if it cannot be read, has no
// triangles or more than `most_triangles` (its message says how many), or has a coordinate that is not finite; the
// message names the first such triangle. A child process runs assimp, which crashes on some damaged files and never
// returns from others: within 2 s of processor time and 2 s more for every megabyte. What has too many triangles is
// refused there, before its triangles take memory here.
TriangleMesh read_mesh(const std::string& path, double unit = 1.0, std::size_t most_triangles = kMostFileTriangles);

// As read_mesh, for a mesh that bounds a solid. Triangles that are there twice are dropped; flipped ones are turned as
// their neighbours are, and shells that are inside out, save walls of cavities. Several shells may be apart, or touch
// along an edge. Throws InputError if the surface has holes, inner walls or one side only, with the place in the file's
// own coordinates, or encloses no volume, or lies so far from the origin that single precision spoils it.
TriangleMesh read_solid_mesh(const std::string& path, double unit = 1.0);

// As read_solid_mesh, but small holes are filled, as scanned meshes have them: all of them if together they would take
// no more than kMostOpenShare of the surface (stability/mesh_holes.h); otherwise InputError says what share they would
// take.
struct MendedMesh {
  TriangleMesh mesh;
  std::size_t holes = 0, open_edges = 0;  // that were filled; edges that bounded them
  double filled_share = 0.0;              // of the surface
};
MendedMesh read_mended_mesh(const std::string& path, double unit = 1.0,
                            std::size_t most_triangles = kMostFileTriangles);

// "cup.stl: 2 holes (34 open edges) filled, 1.2 % of the surface"; empty if nothing was.
std::string mending_note(const std::string& path, const MendedMesh& mended);

// For programs that take a file's `unit` from the argument `unit_option`. Throws InputError if the diameter, in metres
// with that unit, is under 1 mm or over 10 m; the message names the size, and a unit that would make it plausible.
void check_object_size(const std::string& path, double object_diameter, double unit, const std::string& unit_option);

// OBJ text, metres, with nine significant digits; and one line of it, for a triangle.
std::string to_obj(const TriangleMesh& mesh);
std::string obj_face(const Eigen::Vector3i& triangle);
void write_obj(const TriangleMesh& mesh, const std::string& path);

}  // namespace dofusion
