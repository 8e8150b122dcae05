#include "diffusion/weights.h"

#include <cmath>
#include <cstring>
#include <filesystem>

#include <gmock/gmock.h>

#include "stability/files.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using testing::HasSubstr;

std::string file_of(const std::string& header, const std::string& data) {
  std::string bytes;
  for (int i = 0; i < 8; ++i) bytes.push_back(static_cast<char>(header.size() >> (8 * i) & 0xff));
  return bytes + header + data;
}

std::string error_of(const std::string& bytes) {
  try {
    parse_safetensors(bytes, "bad.safetensors");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string floats(std::initializer_list<float> values) {
  return {reinterpret_cast<const char*>(values.begin()), values.size() * 4};
}

class ModelFileTest : public testing::Test {
 protected:
  void SetUp() override {
    config_.widths = {32};
    config_.embedding = 32;
    config_.hidden = 32;
    path_ = folder_ / "model.safetensors";
  }
  std::string read_error() {
    try {
      read_model(path_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  ModelConfig config_;
  TemporaryDirectory folder_;
  std::string path_;
};

TEST(Safetensors, RoundTrip) {
  TensorFile file;
  file.metadata = {{"config", "{\"a\": \"\\u00e9\"}"}};
  file.tensors = {{"a", {2, 3}, {1, 2, 3, 4, 5, 6}}, {"empty", {0, 4}, {}}, {"scalar", {}, {7}}};
  const std::string bytes = to_safetensors(file);
  EXPECT_EQ(bytes.size() % 4, 0u);
  const TensorFile again = parse_safetensors(bytes, "memory");
  EXPECT_EQ(again.metadata, file.metadata);
  ASSERT_EQ(again.tensors.size(), 3u);
  for (const NamedTensor& t : file.tensors) {
    bool found = false;
    for (const NamedTensor& u : again.tensors)
      found = found || (u.name == t.name && u.shape == t.shape && u.values == t.values);
    EXPECT_TRUE(found) << t.name;
  }
}

TEST(Safetensors, HostileFilesAreRefusedWithAReason) {
  EXPECT_THAT(error_of(""), HasSubstr("bad.safetensors: not a safetensors file"));
  EXPECT_THAT(error_of("1234567"), HasSubstr("only 7 bytes"));
  EXPECT_THAT(error_of(std::string(8, '\xff') + "{}"), HasSubstr("cut short"));
  EXPECT_THAT(error_of(file_of("{", "")), HasSubstr("not valid JSON"));
  EXPECT_THAT(error_of(file_of("[]", "")), HasSubstr("plain object"));
  EXPECT_THAT(error_of(file_of(std::string(50000, '['), "")), HasSubstr("safetensors"));
  const std::string one = floats({1});
  const auto tensor = [](const std::string& type, const std::string& shape, const std::string& offsets) {
    return R"("t":{"dtype":")" + type + R"(","shape":)" + shape + R"(,"data_offsets":)" + offsets + "}";
  };
  EXPECT_EQ(error_of(file_of("{" + tensor("F32", "[1]", "[0,4]") + "}", one)), "");
  EXPECT_THAT(error_of(file_of("{" + tensor("F64", "[1]", "[0,4]") + "}", one)), HasSubstr("has type \"F64\""));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[2]", "[0,4]") + "}", one)), HasSubstr("does not fit its 4 bytes"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1]", "[0,8]") + "}", one)), HasSubstr("outside the file"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1]", "[4,0]") + "}", one)), HasSubstr("outside the file"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[-1]", "[0,4]") + "}", one)), HasSubstr("invalid shape"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1.5]", "[0,4]") + "}", one)), HasSubstr("invalid shape"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "3", "[0,4]") + "}", one)), HasSubstr("invalid shape"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1]", "[0]") + "}", one)), HasSubstr("invalid data_offsets"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1]", "[-4,0]") + "}", one)), HasSubstr("invalid data_offsets"));
  // 2^32 * 2^32 * 4 overflows 64 bits to zero.
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[4294967296,4294967296]", "[0,0]") + "}", "")),
              HasSubstr("does not fit"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1]", "[0,4]") + "," + tensor("F32", "[1]", "[0,4]") + "}", one)),
              HasSubstr("twice"));
  const std::string second = R"("u":{"dtype":"F32","shape":[1],"data_offsets":[0,4]})";
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1]", "[0,4]") + "," + second + "}", one)), HasSubstr("overlap"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1]", "[0,4]") + "}", one + one)), HasSubstr("no tensor"));
  EXPECT_THAT(error_of(file_of("{" + tensor("F32", "[1]", "[0,4]") + "}", floats({NAN}))), HasSubstr("not finite"));
  EXPECT_THAT(error_of(file_of(R"({"t":{"dtype":"F32"}})", "")), HasSubstr("lacks"));
  EXPECT_THAT(error_of(file_of(R"({"t":7})", "")), HasSubstr("lacks"));
  EXPECT_THAT(error_of(file_of(R"({"__metadata__":{"a":1}})", "")), HasSubstr("not text"));
}

// Every prefix of a good file is refused, none crashes.
TEST(Safetensors, CutFilesAreRefused) {
  TensorFile file;
  file.tensors = {{"a", {4}, {1, 2, 3, 4}}};
  const std::string bytes = to_safetensors(file);
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_THROW(parse_safetensors(bytes.substr(0, n), "cut"), InputError) << n;
}

TEST_F(ModelFileTest, RoundTrip) {
  const auto network = make_network(config_);
  ModelFile model{config_, "{\"steps\":3}", network->initial_parameters(5)};
  write_model(model, path_);
  const ModelFile again = read_model(path_);
  EXPECT_EQ(again.parameters, model.parameters);
  EXPECT_EQ(again.training, model.training);
  EXPECT_EQ(to_json(again.config), to_json(config_));
}

TEST_F(ModelFileTest, AnotherArchitectureIsNamed) {
  const auto network = make_network(config_);
  TensorFile file;
  ModelConfig other = config_;
  other.hidden = 64;
  file.metadata = {{"format", "dofusion-placement-model"}, {"config", to_json(other)}};
  file.tensors = split_parameters(network->tensors(), network->initial_parameters(1));
  write_safetensors(file, path_);
  EXPECT_THAT(read_error(), HasSubstr("another architecture: tensor 'mlp.1.weight' has shape"));
  file.tensors[0].name = "renamed";
  write_safetensors(file, path_);
  EXPECT_THAT(read_error(), HasSubstr("there is no tensor 'encoder.edge1.weight'"));
  file.tensors.pop_back();
  write_safetensors(file, path_);
  EXPECT_THAT(read_error(), HasSubstr("tensors where the configuration needs"));
  file.metadata.erase("format");
  write_safetensors(file, path_);
  EXPECT_THAT(read_error(), HasSubstr("not a placement model"));
  EXPECT_THAT(read_error(), HasSubstr(path_));
}

TEST_F(ModelFileTest, MissingFileIsNamed) { EXPECT_THAT(read_error(), HasSubstr(path_)); }

}  // namespace
}  // namespace dofusion
