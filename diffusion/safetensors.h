// Tensors in the safetensors format: 8 bytes header length (little endian), a JSON header that names type, shape and
// bytes of every tensor, then the raw values. Reading runs nothing that is in the file.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace dofusion {

struct NamedTensor {
  std::string name;
  std::vector<std::int64_t> shape;
  std::vector<float> values;  // row-major
};

struct TensorFile {
  std::map<std::string, std::string> metadata;
  std::vector<NamedTensor> tensors;
};

// Throws InputError naming the file and what is wrong with it: too short, header longer than the file, not JSON, a type
// other than F32, a shape that does not fit the bytes, bytes out of range, overlapping or left over, a value that is
// not finite.
TensorFile read_safetensors(const std::string& path);
TensorFile parse_safetensors(const std::string& bytes, const std::string& source);

// Writes whole or not at all. Throws InputError naming the file.
void write_safetensors(const TensorFile& file, const std::string& path);
std::string to_safetensors(const TensorFile& file);

}  // namespace dofusion
