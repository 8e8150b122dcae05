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
  write_file(directory / "out/objects/9.obj", "mine too");
  OutputDirectory output(directory / "out");
  write_file(output.path() / "f", "new");
  fs::create_directories(output.path() / "objects");
  output.commit();
  EXPECT_EQ(read_file(directory / "out/mine"), "keep");
  EXPECT_EQ(read_file(directory / "out/f"), "new");
  EXPECT_EQ(read_file(directory / "out/objects/9.obj"), "mine too");
  EXPECT_EQ(std::distance(fs::directory_iterator(directory.path()), {}), 1);
}

TEST(WriteFile, LinksArePointedToStill) {
  const TemporaryDirectory directory;
  write_file(directory / "file", "old");
  fs::create_symlink(directory / "file", directory / "link");
  write_file(directory / "link", "new");
  EXPECT_TRUE(fs::is_symlink(directory / "link"));
  EXPECT_EQ(read_file(directory / "file"), "new");
  write_file("/dev/null", "nothing");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST(CheckWritable, SaysWhatWriteFileWouldSayAndLeavesNothing) {
  const TemporaryDirectory directory;
  EXPECT_NO_THROW(check_writable(directory / "a"));
  EXPECT_TRUE(fs::is_empty(directory.path()));
  EXPECT_THROW(check_writable(directory / "no/a"), InputError);
  EXPECT_THROW(check_writable(directory.path()), InputError);
  EXPECT_NO_THROW(check_writable("/dev/null"));
}

TEST(OutputDirectory, FoldersMadeOnTheWayGoUnlessCommitted) {
  const TemporaryDirectory directory;
  { const OutputDirectory dropped(directory / "a/b/out/"); }
  EXPECT_TRUE(fs::is_empty(directory.path()));
  OutputDirectory kept(directory / "a/b/out/");
  kept.commit();
  EXPECT_TRUE(fs::is_empty(directory / "a/b/out"));
  EXPECT_EQ(std::distance(fs::directory_iterator(directory / "a/b"), {}), 1);
  EXPECT_THROW(OutputDirectory(""), InputError);
}

TEST(OutputDirectory, RefusesAFile) {
  const TemporaryDirectory directory;
  write_file(directory / "file", "x");
  EXPECT_THROW(OutputDirectory(directory / "file"), InputError);
  EXPECT_THROW(OutputDirectory(directory / "file/below"), InputError);
}

}  // namespace
}  // namespace dofusion
