#include "stability/dataset_journal.h"

#include <gmock/gmock.h>

#include "stability/files.h"
#include "tests/file_size_limit.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

JournalEntry entry_of(std::int64_t index) {
  JournalEntry entry;
  entry.scene.part = 2;
  entry.scene.index = index;
  entry.scene.task = Task::kStack;
  entry.drops = 5;
  entry.accepted = 2;
  entry.restarts = 1;
  Rng rng = make_rng(9, static_cast<std::uint64_t>(index));
  for (int k = 0; k < 2; ++k) {
    SceneObject object;
    object.shape = k + 3;
    object.touches = 1u << k;
    object.scale = normal3(rng).cwiseAbs();
    object.T_world_object = make_pose(random_rotation(rng), normal3(rng));
    entry.scene.objects.push_back(object);
  }
  return entry;
}

class JournalTest : public testing::Test {
 protected:
  std::vector<std::int64_t> indices() {
    const SceneJournal journal(path_, "settings");
    std::vector<std::int64_t> found;
    journal.for_each([&](const JournalEntry& entry) { found.push_back(entry.scene.index); });
    return found;
  }
  void append(std::vector<std::int64_t> list) {
    SceneJournal journal(path_, "settings");
    for (const std::int64_t index : list) journal.append(encode_entry(entry_of(index)));
  }
  std::string message(const std::string& settings) {
    try {
      const SceneJournal journal(path_, settings);
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  }
  TemporaryDirectory directory_;
  std::string path_ = directory_ / "job.partial";
};

TEST_F(JournalTest, EntriesComeBackExactly) {
  append({4, 1});
  const SceneJournal journal(path_, "settings");
  int seen = 0;
  journal.for_each([&](const JournalEntry& entry) {
    const JournalEntry expected = entry_of(seen++ == 0 ? 4 : 1);
    EXPECT_EQ(encode_entry(entry), encode_entry(expected));
    EXPECT_EQ(entry.scene.part, 2);
    EXPECT_EQ(entry.scene.index, expected.scene.index);
    EXPECT_EQ(entry.scene.task, Task::kStack);
    EXPECT_EQ(entry.drops, 5);
    EXPECT_EQ(entry.accepted, 2);
    EXPECT_EQ(entry.restarts, 1);
    ASSERT_EQ(entry.scene.objects.size(), 2u);
    for (int k = 0; k < 2; ++k) {
      EXPECT_EQ(entry.scene.objects[k].T_world_object.matrix(), expected.scene.objects[k].T_world_object.matrix());
      EXPECT_EQ(entry.scene.objects[k].scale, expected.scene.objects[k].scale);
    }
  });
  EXPECT_EQ(seen, 2);
  EXPECT_THROW(decode_entry("short"), InputError);
}

TEST_F(JournalTest, TornEndsAreDroppedAndTheJournalGoesOn) {
  append({});
  const std::size_t header = read_file(path_).size();
  append({0, 1});
  const std::string whole = read_file(path_);
  const std::size_t entry = (whole.size() - header) / 2;
  for (std::size_t length = 0; length < whole.size(); length += 7) {
    write_file(path_, whole.substr(0, length));
    append({8});
    const std::size_t left = length < header ? 0 : (length - header) / entry;
    std::vector<std::int64_t> expected;
    for (std::size_t i = 0; i < left; ++i) expected.push_back(static_cast<std::int64_t>(i));
    expected.push_back(8);
    EXPECT_EQ(indices(), expected) << length;
  }
}

TEST_F(JournalTest, DamagedEntryIsAsIfItWereNeverMade) {
  append({});
  const std::size_t header = read_file(path_).size();
  append({0, 1, 2});
  const std::string whole = read_file(path_);
  const std::size_t entry = (whole.size() - header) / 3;
  for (std::size_t byte = 0; byte < entry; byte += 5) {  // its mark, length, payload or checksum
    std::string damaged = whole;
    damaged[header + entry + byte] = static_cast<char>(damaged[header + entry + byte] ^ 0x55);
    write_file(path_, damaged);
    EXPECT_THAT(indices(), ElementsAre(0, 2)) << byte;
  }
  append({1});
  EXPECT_THAT(indices(), ElementsAre(0, 2, 1));
}

TEST_F(JournalTest, OtherSettingsAndOtherFilesAreRefusedAndKept) {
  append({0});
  const std::string before = read_file(path_);
  EXPECT_THAT(message("settingz"), HasSubstr("job.partial: left by a run with other settings"));
  EXPECT_THAT(message("set"), HasSubstr("other settings"));
  EXPECT_TRUE(read_file(path_) == before);
  write_file(path_, "my notes");
  EXPECT_THAT(message("settings"), HasSubstr("job.partial: not the journal"));
  EXPECT_EQ(read_file(path_), "my notes");
}

TEST_F(JournalTest, OneWithoutScenesTakesOtherSettings) {
  append({});
  EXPECT_EQ(message("other and longer settings"), "no error");
  EXPECT_EQ(message("others"), "no error");
  EXPECT_TRUE(indices().empty());
}

TEST_F(JournalTest, TwoRunsAtOnceAreRefused) {
  SceneJournal first(path_, "settings");
  EXPECT_THAT(message("settings"), HasSubstr("job.partial: another run is at work on it"));
  first.append(encode_entry(entry_of(0)));
  first.remove();
  EXPECT_EQ(message("settings"), "no error");  // a new one
}

TEST_F(JournalTest, FullDiskIsAnErrorThatLosesNothing) {
  append({0, 1});
  const std::size_t size = read_file(path_).size();
  {
    const FileSizeLimit full(size + 50);
    SceneJournal journal(path_, "settings");
    try {
      journal.append(encode_entry(entry_of(2)));
      FAIL();
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr("job.partial: cannot be written (File too large); the same command goes on"));
    }
  }
  append({3});
  EXPECT_THAT(indices(), ElementsAre(0, 1, 3));
}

}  // namespace
}  // namespace dofusion
