// Safetensors, and an entry of a generation journal.
#include "diffusion/safetensors.h"
#include "stability/dataset_journal.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dofusion;
  const std::string bytes = to_bytes(data, size);
  try {
    parse_safetensors(bytes, "fuzz.safetensors");
  } catch (const InputError&) {
  }
  try {
    decode_entry(bytes);
  } catch (const InputError&) {
  }
  return 0;
}
