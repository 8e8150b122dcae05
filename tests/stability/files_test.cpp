#include "stability/files.h"

#include <gtest/gtest.h>

#include "tests/temporary_directory.h"

namespace dofusion {
namespace {
namespace fs = std::filesystem;

TEST(WriteFile, ReplacesAndLeavesNothingBeside) {
  const TemporaryDirectory directory;
  write_file(directory / "a", "first");
  write_file(directory / "a", "second");
  EXPECT_EQ(read_file(directory / "a"), "second");
  EXPECT_EQ(std::distance(fs::directory_iterator(directory.path()), {}), 1);
  EXPECT_THROW(write_file(directory / "no/a", "x"), InputError);
  EXPECT_THROW(read_file(directory / "none"), InputError);
}

TEST(OutputDirectory, AppearsOnCommitOnly) {
  const TemporaryDirectory directory;
  {
    const OutputDirectory dropped(directory / "out");
    write_file(dropped.path() / "f", "x");
  }
  EXPECT_TRUE(fs::is_empty(directory.path()));
  {
    OutputDirectory kept(directory / "out");
    write_file(kept.path() / "f", "x");
    kept.commit();
  }
  EXPECT_EQ(read_file(directory / "out/f"), "x");
}

TEST(OutputDirectory, KeepsWhatElseIsThere) {
  const TemporaryDirectory directory;
  fs::create_directories(directory / "out/objects");
  write_file(directory / "out/mine", "keep");
  write_file(directory / "out/f", "old");
  write_file(directory / "out/objects/9.obj", "of an earlier run");
  OutputDirectory output(directory / "out");
  write_file(output.path() / "f", "new");
  fs::create_directories(output.path() / "objects");
  output.commit();
  EXPECT_EQ(read_file(directory / "out/mine"), "keep");
  EXPECT_EQ(read_file(directory / "out/f"), "new");
  EXPECT_TRUE(fs::is_empty(directory / "out/objects"));
  EXPECT_EQ(std::distance(fs::directory_iterator(directory.path()), {}), 1);
}

TEST(OutputDirectory, RefusesAFile) {
  const TemporaryDirectory directory;
  write_file(directory / "file", "x");
  EXPECT_THROW(OutputDirectory(directory / "file"), InputError);
  EXPECT_THROW(OutputDirectory(directory / "file/below"), InputError);
}

}  // namespace
}  // namespace dofusion
