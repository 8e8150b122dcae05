#include "stability/dataset.h"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/file.h>
#include <unistd.h>

#include "stability/files.h"
#include "stability/hdf5_file.h"
#include "stability/shapes.h"
#include "tests/file_size_limit.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

using testing::HasSubstr;

// An L of two boxes that share a whole face.
ObjectPtr make_corner() {
  const TriangleMesh mesh =
      prism_mesh({{0, 0}, {0.06, 0}, {0.06, 0.02}, {0.02, 0.02}, {0.02, 0.06}, {0, 0.06}}, 0, 0.03);
  const TriangleMesh lower = translated(box_mesh({0.06, 0.02, 0.03}), {0.03, 0.01, 0.015});
  const TriangleMesh upper = translated(box_mesh({0.02, 0.04, 0.03}), {0.01, 0.04, 0.015});
  return make_object("corner", mesh, {lower, upper}).object;
}

// Scenes of every task, of one to three objects, in two parts.
SceneDataset small_dataset() {
  SceneDataset dataset;
  dataset.shapes = {make_block("cube"), make_block("hat"), make_cylinder("can", 0.03, 0.1), make_block("rectangle")};
  dataset.settings = R"({"seed":3})";
  Rng rng = make_rng(1);
  for (int i = 0; i < 12; ++i) {
    SceneRecord scene;
    scene.task = static_cast<Task>(i % 3);
    scene.part = i / 6;
    scene.index = i % 6;
    scene.split = static_cast<Split>(i % 4 % 3);
    for (int k = 0; k <= i % 3; ++k) {
      SceneObject object;
      object.shape = (i + k) % 4;
      object.scale = object.shape == 0 ? Eigen::Vector3d(1.0, 2.0, 0.5) : Eigen::Vector3d::Constant(1.0 + k);
      object.T_world_object = make_pose(random_rotation(rng), normal3(rng, 0.1));
      object.touches = k == 0 ? 1u : 1u << k;
      scene.objects.push_back(object);
    }
    dataset.scenes.push_back(scene);
  }
  return dataset;
}

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

std::string reading(const std::string& path) {
  return message_of([&] { read_dataset(path); });
}

TEST(Dataset, ComesBackAsItWasWritten) {
  const TemporaryDirectory directory;
  const SceneDataset written = small_dataset();
  write_dataset(written, directory / "scenes.h5");
  const SceneDataset read = read_dataset(directory / "scenes.h5");
  EXPECT_EQ(read.settings, written.settings);
  ASSERT_EQ(read.scenes.size(), written.scenes.size());
  for (std::size_t i = 0; i < read.scenes.size(); ++i) {
    EXPECT_EQ(read.scenes[i].task, written.scenes[i].task);
    EXPECT_EQ(read.scenes[i].part, written.scenes[i].part);
    EXPECT_EQ(read.scenes[i].index, written.scenes[i].index);
    EXPECT_EQ(read.scenes[i].split, written.scenes[i].split);
    ASSERT_EQ(read.scenes[i].objects.size(), written.scenes[i].objects.size());
    for (std::size_t k = 0; k < read.scenes[i].objects.size(); ++k) {
      const SceneObject &a = read.scenes[i].objects[k], &b = written.scenes[i].objects[k];
      EXPECT_EQ(a.shape, b.shape);
      EXPECT_EQ(a.touches, b.touches);
      EXPECT_EQ(a.scale, b.scale);
      EXPECT_TRUE(a.T_world_object.isApprox(b.T_world_object, 1e-12));
    }
  }
  const Scene scene = to_scene(read, read.scenes[8]);  // a cube, a hat and a can of two and three times their size
  ASSERT_EQ(scene.objects.size(), 3u);
  EXPECT_TRUE(scene.objects[0]->box_edges->isApprox(Eigen::Vector3d(0.05, 0.1, 0.025), 1e-12));
  EXPECT_EQ(scene.objects[2]->kind, SolidKind::kCylinder);
}

TEST(Dataset, ShapesKeepKindInertiaAndConvexParts) {
  const TemporaryDirectory directory;
  SceneDataset written;
  written.shapes = {make_block("hat"), make_box("box", {0.1, 0.2, 0.3}), make_cylinder("can", 0.03, 0.1),
                    make_sphere("ball", 0.02), make_corner()};
  written.settings = "{}";
  write_dataset(written, directory / "shapes.h5");
  const SceneDataset read = read_dataset(directory / "shapes.h5");
  ASSERT_EQ(read.shapes.size(), written.shapes.size());
  for (std::size_t s = 0; s < read.shapes.size(); ++s) {
    const Object &a = *read.shapes[s], &b = *written.shapes[s];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.kind, b.kind) << a.name;
    EXPECT_EQ(a.convex, b.convex) << a.name;
    EXPECT_EQ(a.mesh.vertices, b.mesh.vertices) << a.name;
    EXPECT_EQ(a.mesh.triangles, b.mesh.triangles) << a.name;
    EXPECT_DOUBLE_EQ(a.volume, b.volume) << a.name;
    EXPECT_DOUBLE_EQ(a.diameter, b.diameter) << a.name;
    EXPECT_TRUE(a.inertia.isApprox(b.inertia, 1e-14)) << a.name;
    ASSERT_EQ(a.parts.size(), b.parts.size()) << a.name;
    for (std::size_t k = 0; k < a.parts.size(); ++k) EXPECT_EQ(a.parts[k].vertices, b.parts[k].vertices);
  }
  EXPECT_EQ(read.shapes[4]->parts.size(), 2u);
}

TEST(Dataset, BytesDoNotDependOnTheTimeOfDay) {
  const TemporaryDirectory directory;
  write_dataset(small_dataset(), directory / "a.h5");
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // HDF5 counts time in seconds
  write_dataset(small_dataset(), directory / "b.h5");
  EXPECT_TRUE(read_file(directory / "a.h5") == read_file(directory / "b.h5"));
}

TEST(Dataset, FiltersTakeScenesThatMeetEveryCondition) {
  const TemporaryDirectory directory;
  const SceneDataset all = small_dataset();
  write_dataset(all, directory / "scenes.h5");
  const auto expect = [&](const DatasetFilter& filter, const std::function<bool(const SceneRecord&)>& wanted) {
    std::vector<std::pair<int, std::int64_t>> expected, taken;
    for (const SceneRecord& scene : all.scenes) {
      if (wanted(scene)) expected.emplace_back(scene.part, scene.index);
    }
    for (const SceneRecord& scene : read_dataset(directory / "scenes.h5", filter).scenes) {
      taken.emplace_back(scene.part, scene.index);
    }
    EXPECT_EQ(taken, expected);
    EXPECT_LT(taken.size(), all.scenes.size());
  };
  const auto has_hat = [](const SceneRecord& scene) {
    return std::any_of(scene.objects.begin(), scene.objects.end(), [](const SceneObject& o) { return o.shape == 1; });
  };
  DatasetFilter filter;
  filter.split = Split::kTest;
  expect(filter, [](const SceneRecord& s) { return s.split == Split::kTest; });
  filter.tasks = {Task::kStack};
  expect(filter, [](const SceneRecord& s) { return s.split == Split::kTest && s.task == Task::kStack; });
  filter = {};
  filter.tasks = {Task::kSingle, Task::kStack};
  expect(filter, [](const SceneRecord& s) { return s.task != Task::kUnstructured; });
  filter = {};
  filter.objects = 2;
  expect(filter, [](const SceneRecord& s) { return s.objects.size() == 2; });
  filter = {};
  filter.with_shape = "hat";
  expect(filter, has_hat);
  filter = {};
  filter.without_shape = "hat";
  expect(filter, [&](const SceneRecord& s) { return !has_hat(s); });
  filter.most = 3;
  EXPECT_EQ(read_dataset(directory / "scenes.h5", filter).scenes.size(), 3u);
  filter.most = 0;
  EXPECT_TRUE(read_dataset(directory / "scenes.h5", filter).scenes.empty());
}

TEST(Split, SharesAreAsAskedAndSeedsDiffer) {
  const int n = 100000;
  std::map<Split, int> count;
  int moved = 0;
  for (int i = 0; i < n; ++i) {
    const Split split = split_of(7, 2, i, {0.1, 0.2});
    ++count[split];
    moved += split == split_of(8, 2, i, {0.1, 0.2}) ? 0 : 1;
    // More scenes for tests do not move one from training to validation.
    if (split_of(7, 2, i) == Split::kValidation) {
      EXPECT_EQ(split, Split::kValidation);
    }
  }
  // Four standard deviations of a binomial share.
  EXPECT_NEAR(count[Split::kValidation] / double(n), 0.1, 4 * std::sqrt(0.1 * 0.9 / n));
  EXPECT_NEAR(count[Split::kTest] / double(n), 0.2, 4 * std::sqrt(0.2 * 0.8 / n));
  EXPECT_GT(moved, n / 3);
  EXPECT_EQ(split_of(7, 2, 5, {0, 0}), Split::kTrain);
  EXPECT_EQ(split_of(7, 2, 5, {0, 1}), Split::kTest);
  EXPECT_THROW(split_of(7, 2, 5, {0.6, 0.6}), std::invalid_argument);
  EXPECT_THROW(split_of(7, 2, 5, {-0.1, 0.6}), std::invalid_argument);
  EXPECT_THROW(split_from_string("exam"), std::invalid_argument);
}

TEST(Dataset, MissingAndForeignFilesAreNamed) {
  const TemporaryDirectory directory;
  EXPECT_THAT(reading(directory / "none.h5"), HasSubstr("none.h5: no such"));
  EXPECT_THAT(reading(directory.path()), HasSubstr("no such dataset"));
  write_file(directory / "text.h5", "not hdf5");
  EXPECT_THAT(reading(directory / "text.h5"), HasSubstr("text.h5: not an HDF5 file"));
  write_file(directory / "empty.h5", "");
  EXPECT_THAT(reading(directory / "empty.h5"), HasSubstr("empty.h5: not an HDF5 file"));
  Hdf5Writer other;
  other.group("/scenes");
  write_file(directory / "other.h5", other.bytes());
  EXPECT_THAT(reading(directory / "other.h5"), HasSubstr("other.h5: attribute 'format' is missing"));
  Hdf5Writer old;
  old.text_attribute("format", "dofusion-scenes");
  old.integer_attribute("version", 1);
  write_file(directory / "old.h5", old.bytes());
  EXPECT_THAT(reading(directory / "old.h5"), HasSubstr("old.h5: version 1, this program reads 2; generate it again"));
}

TEST(Dataset, NoCutOfAFileIsReadOrCrashes) {
  const TemporaryDirectory directory;
  SceneDataset dataset = small_dataset();
  dataset.shapes.resize(2);  // the can's mesh is large
  dataset.scenes.resize(1);
  write_dataset(dataset, directory / "whole.h5");
  const std::string bytes = read_file(directory / "whole.h5");
  for (std::size_t length = 0; length < bytes.size(); length += length < 4096 ? 61 : 509) {
    write_file(directory / "cut.h5", bytes.substr(0, length));
    EXPECT_THAT(reading(directory / "cut.h5"), HasSubstr("cut.h5: ")) << length;
  }
  EXPECT_THAT(reading(directory / "cut.h5"), HasSubstr("damaged or cut short"));
}

TEST(Dataset, FileThatIsBeingWrittenIsNamed) {
  const TemporaryDirectory directory;
  write_dataset(small_dataset(), directory / "busy.h5");
  const int file = ::open((directory / "busy.h5").c_str(), O_RDWR);
  ASSERT_EQ(::flock(file, LOCK_EX | LOCK_NB), 0);  // as HDF5 does when it opens a file for writing
  EXPECT_THAT(reading(directory / "busy.h5"), HasSubstr("busy.h5: is open for writing elsewhere"));
  ::close(file);
  EXPECT_EQ(reading(directory / "busy.h5"), "no error");
}

TEST(Dataset, ValuesThatCannotBeAreNamed) {
  const TemporaryDirectory directory;
  const auto written = [&](const std::function<void(SceneDataset&)>& spoil) {
    SceneDataset dataset = small_dataset();
    spoil(dataset);
    write_dataset(dataset, directory / "bad.h5");
    return reading(directory / "bad.h5");
  };
  const auto object = [](SceneDataset& d) -> SceneObject& { return d.scenes[1].objects[0]; };
  EXPECT_THAT(written([&](auto& d) { object(d).shape = 99; }), HasSubstr("/objects/shape: row 1"));
  EXPECT_THAT(written([&](auto& d) { object(d).scale.y() = -1; }), HasSubstr("/objects/scale: row 1"));
  EXPECT_THAT(written([&](auto& d) { object(d).T_world_object.translation().x() = std::nan(""); }),
              HasSubstr("/objects/pose: row 1"));
  EXPECT_THAT(written([&](auto& d) { object(d).touches = 1u << 3; }), HasSubstr("/objects/touches: row 1"));
  EXPECT_THAT(written([&](auto& d) { d.settings = "\xff"; }), HasSubstr("attribute 'settings' is not JSON"));
  EXPECT_THAT(written([&](auto& d) { d.scenes[2].task = static_cast<Task>(7); }), HasSubstr("/scenes/task: row 2"));
  EXPECT_THAT(written([&](auto& d) { d.scenes[2].split = static_cast<Split>(7); }), HasSubstr("/scenes/split: row 2"));
  EXPECT_THAT(written([&](auto& d) {
                auto wrong = std::make_shared<Object>(*d.shapes[1]);
                wrong->kind = SolidKind::kBox;  // a hat
                d.shapes[1] = wrong;
              }),
              HasSubstr("/shapes: row 1, 'hat', is not of the kind"));
}

TEST(Dataset, WhatCannotBeWrittenLeavesTheOldFile) {
  const TemporaryDirectory directory;
  write_dataset(small_dataset(), directory / "old.h5");
  const std::string before = read_file(directory / "old.h5");
  const auto writing = [](const std::string& path) {
    return message_of([&] { write_dataset(small_dataset(), path); });
  };
  {
    const FileSizeLimit full(20'000);
    EXPECT_THAT(writing(directory / "old.h5"), HasSubstr("old.h5: cannot be written (File too large)"));
  }
  EXPECT_TRUE(read_file(directory / "old.h5") == before);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory.path()), {}), 1);
  EXPECT_THAT(writing("/dev/full"), HasSubstr("/dev/full: cannot be written (No space left on device)"));
  EXPECT_THAT(writing(directory / "no/such/folder.h5"), HasSubstr("folder.h5: cannot be written"));
}

}  // namespace
}  // namespace dofusion
