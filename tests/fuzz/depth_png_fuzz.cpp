// 16-bit depth images from PNG files.
#include "perception/depth_io.h"
#include "tests/fuzz/fuzz_file.h"
#include "tests/fuzz/png_checksums.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dofusion;
  const std::string bytes = to_bytes(data, size);
  const Camera camera = camera_of_png<Camera>(bytes);
  const auto read = [&](const std::string& path) { read_depth(path, camera); };
  fuzz_file(bytes, ".png", read);
  fuzz_file(with_right_checksums(bytes), ".png", read);
  return 0;
}
