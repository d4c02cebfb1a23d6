// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/storage/data_folder.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/stat.h>

#include "tests/server/store/stores_case.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::ScopedEnvironment;
using ::tissueform::testing::StatusIs;

unsigned ModeOf(const std::string& path) {
  struct stat status {};
  EXPECT_EQ(stat(path.c_str(), &status), 0) << path;
  return status.st_mode & 07777U;
}

TEST(DataFolderTest, IsMadeForItsOwnerOnly) {
  const ScratchFolder scratch;
  ASSERT_OK_AND_ASSIGN(const DataFolder folder, DataFolder::Open(scratch / "a/b/data/"));
  EXPECT_EQ(folder.path(), scratch / "a/b/data");
  EXPECT_EQ(ModeOf(folder.path()), 0700U);
  EXPECT_EQ(ModeOf(folder.path() + "/lock"), 0600U);
}

TEST(DataFolderTest, RefusesAFolderThatOthersMayEnter) {
  const ScratchFolder scratch;
  for (const mode_t mode : {0755, 0710, 0701}) {
    const std::string path = scratch / absl::StrCat("data", mode);
    ASSERT_EQ(mkdir(path.c_str(), 0700), 0);
    ASSERT_EQ(chmod(path.c_str(), mode), 0);
    EXPECT_THAT(DataFolder::Open(path).status(),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("chmod 700 " + path)));
    EXPECT_FALSE(std::filesystem::exists(path + "/lock"));
  }
}

TEST(DataFolderTest, RefusesPathsThatAreNotFolders) {
  const ScratchFolder scratch;
  std::ofstream(scratch / "file") << "text";
  EXPECT_THAT(DataFolder::Open(scratch / "file").status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("move it")));
  EXPECT_FALSE(DataFolder::Open(scratch / "file/below").ok());
  EXPECT_FALSE(DataFolder::Open("/proc/nothing/can/be/made/here").ok());
}

TEST(DataFolderTest, IsHeldByOneAtATimeAndTheErrorNamesTheHolder) {
  const ScratchFolder scratch;
  {
    ASSERT_OK_AND_ASSIGN(DataFolder first, DataFolder::Open(scratch / "data"));
    const auto second = DataFolder::Open(scratch / "data");
    EXPECT_THAT(second.status(), StatusIs(absl::StatusCode::kUnavailable,
                                          AllOf(HasSubstr(absl::StrCat("process ", getpid())),
                                                HasSubstr("another folder with --data-dir"))));
    const DataFolder moved = std::move(first);
    EXPECT_FALSE(DataFolder::Open(scratch / "data").ok()) << "the lock moves with it";
  }
  EXPECT_THAT(DataFolder::Open(scratch / "data").status(), IsOk());
}

TEST(DataFolderTest, NetworkFileSystemsAreRefusedAndDisksAreNot) {
  for (const int64_t type :
       {0x6969L, 0x517BL, 0xFF534D42L, 0xFE534D42L, 0x01021997L, 0x65735546L}) {
    EXPECT_THAT(CheckFileSystem("/data", type),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("network")));
  }
  // statfs gives a signed number on some machines.
  EXPECT_FALSE(CheckFileSystem("/data", static_cast<int32_t>(0xFF534D42)).ok());
  for (const int64_t type : {0xEF53L /*ext*/, 0x58465342L /*xfs*/, 0x9123683EL /*btrfs*/,
                             0x01021994L /*tmpfs*/, 0x794C7630L /*overlay*/}) {
    EXPECT_THAT(CheckFileSystem("/data", type), IsOk());
  }
}

TEST(DataFolderTest, ARemovedOrReplacedFolderIsNoticed) {
  const ScratchFolder scratch;
  ASSERT_OK_AND_ASSIGN(const DataFolder folder, DataFolder::Open(scratch / "data"));
  EXPECT_THAT(folder.CheckStillThere(), IsOk());
  std::filesystem::rename(scratch / "data", scratch / "moved");
  EXPECT_THAT(folder.CheckStillThere(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("removed or replaced")));
  std::filesystem::create_directory(scratch / "data");
  EXPECT_FALSE(folder.CheckStillThere().ok()) << "another one of that name";
}

TEST(DataFolderTest, TheDefaultLiesInTheUsersState) {
  {
    const ScopedEnvironment state("XDG_STATE_HOME", "/state");
    ASSERT_OK_AND_ASSIGN(const std::string path, DefaultDataFolder());
    EXPECT_EQ(path, "/state/tissueform");
  }
  const ScopedEnvironment state("XDG_STATE_HOME", "relative");
  {
    const ScopedEnvironment home("HOME", "/home/planner");
    ASSERT_OK_AND_ASSIGN(const std::string path, DefaultDataFolder());
    EXPECT_EQ(path, "/home/planner/.local/state/tissueform");
  }
  const ScopedEnvironment home("HOME", "");
  EXPECT_THAT(DefaultDataFolder().status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("--data-dir")));
}

}  // namespace
}  // namespace tissueform
