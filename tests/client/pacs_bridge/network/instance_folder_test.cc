// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/instance_folder.h"

#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/client/pacs_bridge/network/dicom_peers.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class InstanceFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    path_ = EmptyTestFolder(name);
    series_ = WriteCtSeries(EmptyTestFolder(name + "_sent"), {.slices = 1});
    auto folder = InstanceFolder::Open({.path = path_, .watermark_bytes = 0});
    ASSERT_THAT(folder.status(), IsOk());
    folder_ = *std::move(folder);
  }

  absl::StatusOr<ReceivedInstance> Take(const std::string& bytes, const AnnouncedInstance& what) {
    auto partial = folder_->NewPartial();
    if (!partial.ok()) return partial.status();
    WriteTestFile(partial->path(), bytes);
    return folder_->Take(*std::move(partial), what, &sink_);
  }

  fs::path path_;
  CtSeries series_;
  RecordingSink sink_;
  std::unique_ptr<InstanceFolder> folder_;
};

TEST_F(InstanceFolderTest, InstanceThatDiffersFromItsAnnouncementIsRefusedAndRemoved) {
  const std::string bytes = BytesOfFile(series_.files[0]);
  EXPECT_THAT(Take(bytes, {.instance_uid = "1.2.3"}).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("another object or class")));
  EXPECT_THAT(Take(bytes, {.class_uid = "1.2.3"}).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("another object or class")));
  EXPECT_THAT(Take("not a DICOM", {}).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a DICOM file")));
  EXPECT_TRUE(fs::is_empty(path_));
  EXPECT_THAT(sink_.instances(), IsEmpty());
}

TEST_F(InstanceFolderTest, OpeningRemovesPartialFilesOfACrash) {
  EXPECT_THAT(Take(BytesOfFile(series_.files[0]), {}).status(), IsOk());
  WriteTestFile(path_ / "2.25.1.partial", "half");
  const auto again = InstanceFolder::Open({.path = path_, .watermark_bytes = 0});
  ASSERT_THAT(again.status(), IsOk());
  EXPECT_FALSE(fs::exists(path_ / "2.25.1.partial"));
  EXPECT_FALSE(fs::is_empty(path_));
}

TEST_F(InstanceFolderTest, AnObjectIsKnownAgainAfterARestart) {
  const std::string bytes = BytesOfFile(series_.files[0]);
  const auto first = Take(bytes, {});
  ASSERT_THAT(first.status(), IsOk());
  folder_ = *InstanceFolder::Open({.path = path_, .watermark_bytes = 0});
  const auto second = Take(bytes, {});
  ASSERT_THAT(second.status(), IsOk());
  EXPECT_EQ(second->novelty, ReceivedInstance::Novelty::kReplayed);
  EXPECT_EQ(second->path, first->path);
}

TEST_F(InstanceFolderTest, MissingFolderIsReported) {
  EXPECT_THAT(InstanceFolder::Open({.path = path_ / "none"}).status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("make it")));
}

}  // namespace
}  // namespace tissueform::testing
