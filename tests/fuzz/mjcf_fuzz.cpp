// MuJoCo's XML scenes.
#include "stability/mjcf_scene.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dofusion;
  fuzz_file(to_bytes(data, size), ".xml", [](const std::string& path) { MjcfScene(path).to_scene(); });
  return 0;
}
