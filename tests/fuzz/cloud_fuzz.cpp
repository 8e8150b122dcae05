// Point clouds: what begins with "ply" as a PLY file, anything else as a PCD file.
#include "perception/cloud_io.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dofusion;
  const Camera camera{50.0, 50.0, 31.5, 23.5, 64, 48, 1.0};
  const std::string bytes = to_bytes(data, size);
  fuzz_file(bytes, bytes.rfind("ply", 0) == 0 ? ".ply" : ".pcd",
            [&](const std::string& path) { read_cloud_as_depth(path, camera); });
  return 0;
}
