// camera.json.
#include "perception/camera.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dofusion;
  fuzz_file(to_bytes(data, size), ".json", [](const std::string& path) { read_camera(path); });
  return 0;
}
