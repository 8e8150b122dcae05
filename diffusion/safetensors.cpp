#include "diffusion/safetensors.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include <nlohmann/json.hpp>

#include "stability/files.h"

namespace dofusion {
namespace {

using nlohmann::json;

constexpr std::uint64_t kHeaderLimit = 100'000'000;  // as the reference implementation

std::string shape_text(const std::vector<std::int64_t>& shape) { return json(shape).dump(); }

// Number of values of `shape`, or nothing if that overflows or a size is negative.
bool count_values(const std::vector<std::int64_t>& shape, std::uint64_t& count) {
  count = 1;
  for (const std::int64_t n : shape) {
    if (n < 0) return false;
    const auto size = static_cast<std::uint64_t>(n);
    if (size != 0 && count > (std::uint64_t{1} << 40) / size) return false;
    count *= size;
  }
  return true;
}

// nlohmann keeps the last of equal keys; here a name that comes twice is an error.
json parse_header(const std::string& text, const std::string& source) {
  std::vector<std::set<std::string>> seen;
  std::string duplicate;
  bool deep = false;
  const json::parser_callback_t callback = [&](int depth, json::parse_event_t event, json& value) {
    deep = deep || depth > 8;
    if (event == json::parse_event_t::object_start) seen.emplace_back();
    if (event == json::parse_event_t::object_end) seen.pop_back();
    if (event == json::parse_event_t::key && !seen.back().insert(value.get<std::string>()).second)
      duplicate = value.get<std::string>();
    return true;
  };
  json header;
  try {
    header = json::parse(text, callback);
  } catch (const json::exception&) {
    throw InputError(source + ": not a safetensors file: its header is not valid JSON");
  }
  if (!header.is_object() || deep)
    throw InputError(source + ": not a safetensors file: its header is not a plain object");
  if (!duplicate.empty()) throw InputError(source + ": damaged: '" + duplicate + "' stands twice in the header");
  return header;
}

}  // namespace

TensorFile parse_safetensors(const std::string& bytes, const std::string& source) {
  if (bytes.size() < 8)
    throw InputError(source + ": not a safetensors file: only " + std::to_string(bytes.size()) + " bytes");
  std::uint64_t header_size = 0;
  for (int i = 7; i >= 0; --i) header_size = header_size << 8 | static_cast<unsigned char>(bytes[i]);
  if (header_size > kHeaderLimit || header_size > bytes.size() - 8)
    throw InputError(source + ": not a safetensors file, or cut short: the header should have " +
                     std::to_string(header_size) + " bytes, the file has " + std::to_string(bytes.size()));
  const json header = parse_header(bytes.substr(8, header_size), source);
  const std::uint64_t data_start = 8 + header_size, data_size = bytes.size() - data_start;

  TensorFile file;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;
  for (const auto& [name, entry] : header.items()) {
    if (name == "__metadata__") {
      if (!entry.is_object()) throw InputError(source + ": damaged: __metadata__ is not an object");
      for (const auto& [key, value] : entry.items()) {
        if (!value.is_string()) throw InputError(source + ": damaged: metadata '" + key + "' is not text");
        file.metadata[key] = value.get<std::string>();
      }
      continue;
    }
    const auto fail = [&, &tensor = name](const std::string& what) {
      throw InputError(source + ": tensor '" + tensor + "' " + what);
    };
    if (!entry.is_object() || !entry.contains("dtype") || !entry.contains("shape") || !entry.contains("data_offsets"))
      fail("lacks dtype, shape or data_offsets");
    if (!entry["dtype"].is_string() || entry["dtype"] != "F32") fail("has type " + entry["dtype"].dump() + ", not F32");
    const auto is_size = [](const json& n) { return n.is_number_unsigned() && n < (std::uint64_t{1} << 62); };
    const json &shape = entry["shape"], &offsets = entry["data_offsets"];
    if (!shape.is_array() || shape.size() > 8 || !std::all_of(shape.begin(), shape.end(), is_size))
      fail("has an invalid shape");
    if (!offsets.is_array() || offsets.size() != 2 || !is_size(offsets[0]) || !is_size(offsets[1]))
      fail("has invalid data_offsets");
    NamedTensor tensor;
    tensor.name = name;
    tensor.shape = shape.get<std::vector<std::int64_t>>();
    const auto begin = offsets[0].get<std::uint64_t>(), end = offsets[1].get<std::uint64_t>();
    if (begin > end || end > data_size)
      fail("lies outside the file (bytes " + std::to_string(begin) + " to " + std::to_string(end) + " of " +
           std::to_string(data_size) + "): cut short?");
    std::uint64_t count = 0;
    if (!count_values(tensor.shape, count) || count * 4 != end - begin)
      fail("of shape " + shape_text(tensor.shape) + " does not fit its " + std::to_string(end - begin) + " bytes");
    ranges.emplace_back(begin, end);
    tensor.values.resize(count);
    static_assert(sizeof(float) == 4, "float32");
    if (count > 0) std::memcpy(tensor.values.data(), bytes.data() + data_start + begin, count * 4);
    for (const float v : tensor.values)
      if (!std::isfinite(v)) fail("holds a value that is not finite");
    file.tensors.push_back(std::move(tensor));
  }
  std::sort(ranges.begin(), ranges.end());
  std::uint64_t at = 0;
  for (const auto& [begin, end] : ranges) {
    if (begin != at)
      throw InputError(source + ": damaged: tensors overlap or leave a gap at byte " + std::to_string(at));
    at = end;
  }
  if (at != data_size)
    throw InputError(source + ": damaged: " + std::to_string(data_size - at) + " bytes belong to no tensor");
  return file;
}

TensorFile read_safetensors(const std::string& path) { return parse_safetensors(read_file(path), path); }

std::string to_safetensors(const TensorFile& file) {
  json header = json::object();
  if (!file.metadata.empty()) header["__metadata__"] = file.metadata;
  std::uint64_t at = 0;
  for (const NamedTensor& tensor : file.tensors) {
    const std::uint64_t end = at + tensor.values.size() * 4;
    header[tensor.name] = {{"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {at, end}}};
    at = end;
  }
  std::string text = header.dump();
  text.resize((text.size() + 7) / 8 * 8, ' ');
  std::string bytes;
  bytes.reserve(8 + text.size() + at);
  for (int i = 0; i < 8; ++i)
    bytes.push_back(static_cast<char>(static_cast<std::uint64_t>(text.size()) >> (8 * i) & 0xff));
  bytes += text;
  for (const NamedTensor& tensor : file.tensors)
    bytes.append(reinterpret_cast<const char*>(tensor.values.data()), tensor.values.size() * 4);
  return bytes;
}

void write_safetensors(const TensorFile& file, const std::string& path) { write_file(path, to_safetensors(file)); }

}  // namespace dofusion
