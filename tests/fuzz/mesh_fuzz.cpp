// Meshes: the first byte chooses the format (o OBJ, s STL, p PLY; anything else one of them), the file follows.
#include "stability/mesh_io.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dofusion;
  if (size == 0) return 0;
  const char* extensions[] = {".obj", ".stl", ".ply"};
  const int format = data[0] == 'o' ? 0 : data[0] == 's' ? 1 : data[0] == 'p' ? 2 : data[0] % 3;
  fuzz_file(to_bytes(data + 1, size - 1), extensions[format], [](const std::string& path) { read_mended_mesh(path); });
  return 0;
}
