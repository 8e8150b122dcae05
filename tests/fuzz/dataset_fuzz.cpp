// Datasets of scenes (HDF5), and the scenes in them.
#include "stability/dataset.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dofusion;
  fuzz_file(to_bytes(data, size), ".h5", [](const std::string& path) {
    const SceneDataset dataset = read_dataset(path);
    for (const SceneRecord& record : dataset.scenes) to_scene(dataset, record);
  });
  return 0;
}
