// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/atomic_file.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include <sys/resource.h>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;

class AtomicFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) / "atomic_file_test" / info->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  std::string Read(const std::string& name) const {
    std::ifstream stream(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }
  size_t NumFiles() const {
    return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(folder_), {}));
  }

  std::filesystem::path folder_;
};

TEST_F(AtomicFileTest, ContentsArriveAndReplaceOldOnes) {
  EXPECT_THAT(WriteFileAtomically(Path("a"), "one"), IsOk());
  EXPECT_THAT(WriteFileAtomically(Path("a"), std::string("t\0wo", 4)), IsOk());
  EXPECT_EQ(Read("a"), std::string("t\0wo", 4));
  EXPECT_EQ(NumFiles(), 1U);
}

TEST_F(AtomicFileTest, FolderAndDeviceAreNotReplaced) {
  std::filesystem::create_directory(folder_ / "folder");
  EXPECT_THAT(WriteFileAtomically(Path("folder"), "x"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("folder")));
  EXPECT_THAT(WriteFileAtomically("/dev/null", "x"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("device")));
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
  EXPECT_EQ(NumFiles(), 1U);
}

TEST_F(AtomicFileTest, MissingFolderIsNotFound) {
  EXPECT_THAT(WriteFileAtomically(Path("missing/a"), "x"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("missing")));
  EXPECT_THAT(CheckWritable(Path("missing/a")),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("missing")));
  EXPECT_THAT(CheckWritable(Path("a")), IsOk());
  EXPECT_EQ(NumFiles(), 0U);
}

// A limit on the size of files stands for a disk that fills up in the middle of writing.
TEST_F(AtomicFileTest, FullDiskKeepsTheOldFileAndLeavesNoOther) {
  ASSERT_THAT(WriteFileAtomically(Path("a"), "old"), IsOk());
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit full{4096, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &full);
  const absl::Status status = WriteFileAtomically(Path("a"), std::string(100000, 'x'));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("free space")));
  EXPECT_EQ(Read("a"), "old");
  EXPECT_EQ(NumFiles(), 1U);
}

TEST_F(AtomicFileTest, ConcurrentWritersLeaveOneWholeFile) {
  std::vector<std::thread> writers;
  for (char letter = 'a'; letter < 'e'; ++letter) {
    writers.emplace_back([this, letter] {
      for (int round = 0; round < 20; ++round) {
        EXPECT_THAT(WriteFileAtomically(Path("shared"), std::string(100000, letter)), IsOk());
      }
    });
  }
  for (std::thread& writer : writers) writer.join();
  const std::string contents = Read("shared");
  ASSERT_EQ(contents.size(), 100000U);
  EXPECT_EQ(contents, std::string(100000, contents[0]));
  EXPECT_EQ(NumFiles(), 1U);
}

}  // namespace
}  // namespace tissueform
