// A mesh file's triangles as assimp finds them. Private to stability.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace dofusion {

struct ImportedMesh {
  std::vector<std::array<float, 3>> vertices;           // the file's coordinates; may hold what is not finite
  std::vector<std::array<std::uint32_t, 3>> triangles;  // indices of vertices; points and lines are left out
};

// All parts of the file merged, polygons triangulated. assimp never returns from some damaged files and crashes on
// others, so a child process reads, within 2 s of processor time and 2 s more for every megabyte. Throws InputError
// naming the file if that fails, with assimp's reason, or if there are more than `most_triangles`.
ImportedMesh import_mesh(const std::string& path, std::size_t most_triangles);

}  // namespace dofusion
