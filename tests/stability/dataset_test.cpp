#include "stability/dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/files.h"
#include "stability/generation.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

SceneDataset small_dataset() {
  GenerationOptions options;
  options.seed = 3;
  SceneGenerator generator(options);
  SceneDataset dataset;
  dataset.shapes = generator.shapes();
  dataset.settings = to_json(options);
  for (int i = 0; i < 5; ++i) dataset.scenes.push_back(generator.generate(i));
  return dataset;
}

TEST(Dataset, ComesBackAsItWasWritten) {
  const TemporaryDirectory directory;
  const SceneDataset written = small_dataset();
  write_dataset(written, directory / "scenes.h5");
  const SceneDataset read = read_dataset(directory / "scenes.h5");
  EXPECT_EQ(read.settings, written.settings);
  ASSERT_EQ(read.shapes.size(), written.shapes.size());
  ASSERT_EQ(read.scenes.size(), written.scenes.size());
  for (std::size_t i = 0; i < read.scenes.size(); ++i) {
    EXPECT_EQ(read.scenes[i].task, written.scenes[i].task);
    EXPECT_EQ(read.scenes[i].index, written.scenes[i].index);
    ASSERT_EQ(read.scenes[i].objects.size(), written.scenes[i].objects.size());
    for (std::size_t k = 0; k < read.scenes[i].objects.size(); ++k) {
      const SceneObject &a = read.scenes[i].objects[k], &b = written.scenes[i].objects[k];
      EXPECT_EQ(a.shape, b.shape);
      EXPECT_EQ(a.touches, b.touches);
      EXPECT_EQ(a.scale, b.scale);
      EXPECT_TRUE(a.T_world_object.isApprox(b.T_world_object, 1e-12));
    }
  }
  EXPECT_EQ(to_scene(read, read.scenes[0]).objects.size(), 2u);
}

TEST(Dataset, MissingForeignAndTruncatedFilesAreNamed) {
  const TemporaryDirectory directory;
  const auto message = [](const std::string& path) {
    try {
      read_dataset(path);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(message(directory / "none.h5"), testing::HasSubstr("none.h5: no such"));
  write_file(directory / "text.h5", "not hdf5");
  EXPECT_THAT(message(directory / "text.h5"), testing::HasSubstr("text.h5: not an HDF5 file"));
  write_dataset(small_dataset(), directory / "whole.h5");
  const std::string bytes = read_file(directory / "whole.h5");
  write_file(directory / "half.h5", bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT(message(directory / "half.h5"), testing::HasSubstr("half.h5: "));
}

TEST(Dataset, ValuesThatCannotBeAreNamed) {
  const TemporaryDirectory directory;
  SceneDataset dataset = small_dataset();
  dataset.scenes[1].objects[0].shape = 99;
  write_dataset(dataset, directory / "shape.h5");
  EXPECT_THROW(read_dataset(directory / "shape.h5"), InputError);
  dataset = small_dataset();
  dataset.scenes[1].objects[0].T_world_object.translation().x() = std::nan("");
  write_dataset(dataset, directory / "nan.h5");
  EXPECT_THROW(read_dataset(directory / "nan.h5"), InputError);
  EXPECT_THROW(write_dataset(dataset, directory / "no/such/folder.h5"), InputError);
}

}  // namespace
}  // namespace dofusion
