// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/atomic_folder.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;

class AtomicFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    around_ = fs::path(::testing::TempDir()) / "atomic_folder_test" / info->name();
    fs::remove_all(around_);
    fs::create_directories(around_);
  }
  void TearDown() override { fs::remove_all(around_); }

  std::string Path(const std::string& name) const { return (around_ / name).string(); }
  // Names in the folder around the goal, hidden ones too.
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(around_)) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  fs::path around_;
};

void PutFile(const std::string& path) { std::ofstream(path) << "content"; }

TEST_F(AtomicFolderTest, AppearsWithAllItHoldsWhenPublished) {
  ASSERT_OK_AND_ASSIGN(AtomicFolder folder, AtomicFolder::Create(Path("goal")));
  PutFile(folder.path() + "/file");
  fs::create_directory(folder.path() + "/below");
  EXPECT_FALSE(fs::exists(Path("goal")));
  EXPECT_THAT(folder.Publish(), IsOk());
  EXPECT_TRUE(fs::is_regular_file(Path("goal/file")));
  EXPECT_TRUE(fs::is_directory(Path("goal/below")));
}

TEST_F(AtomicFolderTest, PublishedFolderOutlivesItsObjectAndNothingElseIsLeft) {
  {
    ASSERT_OK_AND_ASSIGN(AtomicFolder folder, AtomicFolder::Create(Path("goal/")));
    PutFile(folder.path() + "/file");
    ASSERT_THAT(folder.Publish(), IsOk());
  }
  EXPECT_THAT(Names(), ElementsAre("goal"));
  EXPECT_TRUE(fs::is_regular_file(Path("goal/file")));
}

TEST_F(AtomicFolderTest, UnpublishedFolderLeavesNothing) {
  {
    ASSERT_OK_AND_ASSIGN(AtomicFolder folder, AtomicFolder::Create(Path("goal")));
    PutFile(folder.path() + "/file");
    const AtomicFolder moved = std::move(folder);
    EXPECT_TRUE(fs::exists(moved.path() + "/file"));
  }
  EXPECT_THAT(Names(), IsEmpty());
}

TEST_F(AtomicFolderTest, EmptyFolderIsReplacedAndAFullOneIsNot) {
  fs::create_directory(around_ / "goal");
  {
    ASSERT_OK_AND_ASSIGN(AtomicFolder folder, AtomicFolder::Create(Path("goal")));
    PutFile(folder.path() + "/file");
    ASSERT_THAT(folder.Publish(), IsOk());
  }
  EXPECT_THAT(AtomicFolder::Create(Path("goal")),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("not an empty folder")));
  EXPECT_THAT(Names(), ElementsAre("goal"));
}

TEST_F(AtomicFolderTest, KeepsATargetThatWasFilledInTheMeantime) {
  {
    ASSERT_OK_AND_ASSIGN(AtomicFolder folder, AtomicFolder::Create(Path("goal")));
    fs::create_directory(around_ / "goal");
    PutFile(Path("goal/of_another"));
    EXPECT_THAT(folder.Publish(),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("name a new folder")));
  }
  EXPECT_THAT(Names(), ElementsAre("goal"));
  EXPECT_TRUE(fs::exists(Path("goal/of_another")));
}

TEST_F(AtomicFolderTest, PublishedFolderHasThePermissionsOfAnyNewFolder) {
  fs::create_directory(around_ / "any");
  ASSERT_OK_AND_ASSIGN(AtomicFolder folder, AtomicFolder::Create(Path("goal")));
  EXPECT_EQ(fs::status(fs::path(folder.path()).parent_path()).permissions(), fs::perms::owner_all)
      << "until then nobody else looks in";
  ASSERT_THAT(folder.Publish(), IsOk());
  EXPECT_EQ(fs::status(around_ / "goal").permissions(), fs::status(around_ / "any").permissions());
}

TEST_F(AtomicFolderTest, ErrorsDistinguishPlacesThatCannotBeFilled) {
  EXPECT_THAT(CheckFillable(Path("goal")), IsOk());
  PutFile(Path("file"));
  EXPECT_THAT(CheckFillable(Path("file")),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("not an empty folder")));
  EXPECT_THAT(CheckFillable(Path("missing/goal")),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("make it first")));
  EXPECT_THAT(CheckFillable("."), Not(IsOk()));
}

}  // namespace
}  // namespace tissueform
