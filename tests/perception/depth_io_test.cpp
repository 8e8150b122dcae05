#include "perception/depth_io.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stability/files.h"
#include "stability/random.h"
#include "tests/temporary_directory.h"

namespace dofusion {
namespace {

const Camera kCamera{600.0, 600.0, 31.5, 23.5, 64, 48, 0.1};

DepthImage random_depth() {
  DepthImage depth(kCamera.width, kCamera.height);
  Rng rng = make_rng(1);
  for (float& z : depth.pixels) z = static_cast<float>(uniform(rng, 0.3, 2.0));
  return depth;
}

std::string complaint_of(const std::string& path, const Camera& camera) {
  try {
    read_depth(path, camera);
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(path));
    EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("\n")));
    return error.what();
  }
  return "accepted";
}

TEST(DepthIo, RoundTripIsWithinHalfAStep) {
  const TemporaryDirectory directory;
  const DepthImage depth = random_depth();
  write_depth(depth, kCamera, directory / "depth.png");
  const DepthImage read = read_depth(directory / "depth.png", kCamera);
  ASSERT_EQ(read.pixels.size(), depth.pixels.size());
  const double half_step = 0.05e-3;  // metres; and a float's rounding at 2 m
  for (std::size_t i = 0; i < depth.pixels.size(); ++i) EXPECT_NEAR(read.pixels[i], depth.pixels[i], half_step + 2e-7);
}

TEST(DepthIo, ReadingAndWritingAgainChangesNothing) {
  const TemporaryDirectory directory;
  write_depth(random_depth(), kCamera, directory / "a.png");
  write_depth(read_depth(directory / "a.png", kCamera), kCamera, directory / "b.png");
  EXPECT_EQ(read_file(directory / "a.png"), read_file(directory / "b.png"));
}

TEST(DepthIo, WhatSixteenBitsCannotHoldIsNoReading) {
  const TemporaryDirectory directory;
  DepthImage depth(kCamera.width, kCamera.height);
  depth.pixels[0] = 6.5535f;  // the largest: 65535 steps of 0.1 mm
  depth.pixels[1] = 6.5537f;
  depth.pixels[2] = -1.0f;
  depth.pixels[3] = std::numeric_limits<float>::quiet_NaN();
  depth.pixels[4] = std::numeric_limits<float>::infinity();
  write_depth(depth, kCamera, directory / "depth.png");
  const DepthImage read = read_depth(directory / "depth.png", kCamera);
  EXPECT_FLOAT_EQ(read.pixels[0], 6.5535f);
  for (int i = 1; i < 5; ++i) EXPECT_EQ(read.pixels[i], 0.0f) << i;
}

TEST(DepthIo, ImageWithoutReadingsIsReturned) {
  const TemporaryDirectory directory;
  write_depth(DepthImage(kCamera.width, kCamera.height), kCamera, directory / "depth.png");
  const DepthImage read = read_depth(directory / "depth.png", kCamera);
  EXPECT_THAT(read.pixels, testing::Each(0.0f));
}

TEST(DepthIo, LabelsRoundTrip) {
  const TemporaryDirectory directory;
  LabelImage labels(kCamera.width, kCamera.height);
  for (std::size_t i = 0; i < labels.pixels.size(); ++i) labels.pixels[i] = static_cast<std::uint8_t>(i % 256);
  write_labels(labels, directory / "labels.png");
  EXPECT_EQ(read_labels(directory / "labels.png", kCamera).pixels, labels.pixels);
}

TEST(DepthIo, EveryTruncationIsNoticed) {
  const TemporaryDirectory directory;
  write_depth(random_depth(), kCamera, directory / "whole.png");
  const std::string bytes = read_file(directory / "whole.png");
  const std::string path = directory / "part.png";
  Rng rng = make_rng(2);
  for (int i = 0; i < 100; ++i) {
    const auto kept = static_cast<std::size_t>(uniform_int(rng, 8, static_cast<int>(bytes.size()) - 1));
    write_file(path, bytes.substr(0, kept));
    EXPECT_THAT(complaint_of(path, kCamera), testing::HasSubstr("truncated")) << kept << " of " << bytes.size();
  }
}

TEST(DepthIo, EveryFlippedByteIsNoticed) {
  const TemporaryDirectory directory;
  write_depth(random_depth(), kCamera, directory / "whole.png");
  const std::string bytes = read_file(directory / "whole.png");
  const std::string path = directory / "flipped.png";
  Rng rng = make_rng(3);
  for (int i = 0; i < 100; ++i) {
    std::string damaged = bytes;
    damaged[static_cast<std::size_t>(uniform_int(rng, 0, static_cast<int>(bytes.size()) - 1))] ^= 0x20;
    write_file(path, damaged);
    EXPECT_NE(complaint_of(path, kCamera), "accepted");
  }
}

TEST(DepthIo, OtherFilesAreToldApart) {
  const TemporaryDirectory directory;
  const auto complaint = [&](const std::string& name) { return complaint_of(directory / name, kCamera); };
  EXPECT_THAT(complaint("missing.png"), testing::Not(testing::HasSubstr("accepted")));

  write_file(directory / "empty.png", "");
  EXPECT_THAT(complaint("empty.png"), testing::HasSubstr("empty"));

  write_file(directory / "text.png", "this is not an image at all");
  EXPECT_THAT(complaint("text.png"), testing::HasSubstr("not a PNG"));

  write_labels(LabelImage(kCamera.width, kCamera.height), directory / "eight.png");
  EXPECT_THAT(complaint("eight.png"), testing::HasSubstr("8 bits"));

  Camera larger = kCamera;
  larger.width = 80;
  write_depth(DepthImage(80, 48), larger, directory / "larger.png");
  EXPECT_THAT(complaint("larger.png"), testing::AllOf(testing::HasSubstr("80x48"), testing::HasSubstr("64x48")));
}

TEST(DepthIo, UnwritablePathIsNamed) {
  try {
    write_depth(DepthImage(2, 2), kCamera, "/nowhere/depth.png");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nowhere"));
  }
}

}  // namespace
}  // namespace dofusion
