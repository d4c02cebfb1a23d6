// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/rotated_files.h"

#include <filesystem>
#include <functional>
#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr std::chrono::seconds kLongest{30};

// True as soon as it is; false when it is not within kLongest.
bool WithinPatience(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + kLongest;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::yield();
  }
  return true;
}

class RotatedFilesTest : public ::testing::Test {
 protected:
  ~RotatedFilesTest() override { std::filesystem::remove_all(folder_); }

  absl::StatusOr<std::unique_ptr<RotatedFiles>> Load() const {
    return RotatedFiles::Load(
        {.certificate = files_.certificate, .key = files_.key, .authorities = files_.roots});
  }

  const std::filesystem::path folder_ = EmptyTestFolder("rotated");
  const TestAuthority authority_;
  const TestFiles files_ = authority_.IssueFiles(folder_, "server");
};

TEST_F(RotatedFilesTest, ARewrittenPairIsTakenIntoUse) {
  ASSERT_OK_AND_ASSIGN(const auto files, Load());
  const auto first = files->expiry();
  authority_.IssueFiles(folder_, "server", {.ends = std::chrono::hours(240)});
  EXPECT_TRUE(WithinPatience([&] { return files->rotations() > 0; }));
  EXPECT_GT(files->expiry(), first);
  EXPECT_FALSE(files->alarm());
}

TEST_F(RotatedFilesTest, InvalidFileRaisesAnAlarmUntilAValidOneArrives) {
  ASSERT_OK_AND_ASSIGN(const auto files, Load());
  const auto first = files->expiry();
  WriteTestFile(files_.key, "nonsense");
  EXPECT_TRUE(WithinPatience([&] { return files->alarm(); }));
  EXPECT_EQ(files->rotations(), 0);
  EXPECT_EQ(files->expiry(), first);
  authority_.IssueFiles(folder_, "server");
  EXPECT_TRUE(WithinPatience([&] { return files->rotations() > 0 && !files->alarm(); }));
}

TEST_F(RotatedFilesTest, AFileThatIsGoneRaisesAnAlarm) {
  ASSERT_OK_AND_ASSIGN(const auto files, Load());
  std::filesystem::remove(files_.roots);
  EXPECT_TRUE(WithinPatience([&] { return files->alarm(); }));
}

TEST_F(RotatedFilesTest, ErrorsNameTheFile) {
  WriteTestFile(files_.roots, "nonsense");
  EXPECT_THAT(Load(), StatusIs(kInvalid, HasSubstr(files_.roots)));
  std::filesystem::remove(files_.certificate);
  EXPECT_THAT(Load(), StatusIs(absl::StatusCode::kNotFound, HasSubstr(files_.certificate)));
  EXPECT_THAT(RotatedFiles::Load({.key = files_.key}), StatusIs(kInvalid));
}

TEST(PrivateFileTest, ItsPathOpensToTheNewestContent) {
  ASSERT_OK_AND_ASSIGN(const auto file, PrivateFile::Make("first"));
  const std::string path = file->path();
  EXPECT_THAT(file->Replace("second, and longer"), IsOk());
  EXPECT_EQ(file->path(), path);
  EXPECT_EQ(std::filesystem::file_size(path), std::string("second, and longer").size());
}

}  // namespace
}  // namespace tissueform::testing
