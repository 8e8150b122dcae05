// Mesh files: anything that assimp reads in, Wavefront OBJ out.
#pragma once

#include <string>

#include "stability/mesh.h"

namespace dofusion {

// Reads OBJ, STL, PLY, … ; coordinates are multiplied by `unit` to give metres. All parts of the file are merged,
// polygons triangulated, equal vertices welded. Throws InputError naming the file if it cannot be read, has
// no triangles or has a coordinate that is not finite.
TriangleMesh read_mesh(const std::string& path, double unit = 1.0);

// As read_mesh, and throws InputError naming the file if the mesh is not closed (a solid has no volume
// otherwise); a mesh that is inside out is turned.
TriangleMesh read_solid_mesh(const std::string& path, double unit = 1.0);

// OBJ text, metres, with nine significant digits.
std::string to_obj(const TriangleMesh& mesh);
void write_obj(const TriangleMesh& mesh, const std::string& path);

}  // namespace dofusion
