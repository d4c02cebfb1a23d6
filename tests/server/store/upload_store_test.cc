// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/upload_store.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/stat.h>

#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

class UploadStoreTest : public ::testing::Test {
 protected:
  UploadStoreTest() { Reopen(); }

  void Reopen(const UploadLimits& limits = {}) {
    store_.reset();
    auto store = UploadStore::Open(folder_ / "uploads", limits);
    ASSERT_THAT(store, IsOk());
    store_ = *std::move(store);
  }
  size_t Files() const {
    const std::filesystem::directory_iterator files(folder_ / "uploads");
    return static_cast<size_t>(std::distance(begin(files), end(files)));
  }

  const ScratchFolder folder_;
  std::unique_ptr<UploadStore> store_;
  const MeshPayload mesh_ = SamplePayload(1, 2000);
  const UploadAnnouncement announcement_ = AnnouncementOf(mesh_);
  const std::string& name_ = announcement_.sha256;
  const std::string bytes_ = BytesOf(mesh_);
};

TEST_F(UploadStoreTest, AssemblesAnUploadFromPieces) {
  ASSERT_OK_AND_ASSIGN(const int64_t begin, store_->Begin(announcement_));
  EXPECT_EQ(begin, 0);
  for (size_t offset = 0; offset < bytes_.size(); offset += 1000) {
    ASSERT_THAT(store_->Append(name_, static_cast<int64_t>(offset), bytes_.substr(offset, 1000)),
                IsOk());
  }
  ASSERT_OK_AND_ASSIGN(const UploadAnnouncement announced, store_->Announced(name_));
  EXPECT_EQ(announced.shape.cell_arrays, announcement_.shape.cell_arrays);
  ASSERT_OK_AND_ASSIGN(const MeshPayload read, store_->Read(name_));
  EXPECT_EQ(read.View().Sha256(), name_);
  ASSERT_OK_AND_ASSIGN(const MeshPayload payload, store_->Take(name_));
  EXPECT_EQ(payload.View().segments, mesh_.View().segments);
  EXPECT_EQ(Files(), 0);
  EXPECT_THAT(store_->Committed(name_), StatusIs(absl::StatusCode::kNotFound, HasSubstr(name_)));
}

TEST_F(UploadStoreTest, APartGoesOnAfterARestart) {
  ASSERT_THAT(store_->Begin(announcement_), IsOk());
  ASSERT_THAT(store_->Append(name_, 0, bytes_.substr(0, 5000)), IsOk());
  ASSERT_OK_AND_ASSIGN(int64_t committed, store_->Committed(name_));
  EXPECT_EQ(committed, 5000);
  Reopen();
  ASSERT_OK_AND_ASSIGN(committed, store_->Committed(name_));
  EXPECT_EQ(committed, 5000);
  ASSERT_OK_AND_ASSIGN(committed, store_->Begin(announcement_));
  EXPECT_EQ(committed, 5000) << "the same announcement continues";
  ASSERT_THAT(store_->Append(name_, 5000, bytes_.substr(5000)), IsOk());
  ASSERT_OK_AND_ASSIGN(const MeshPayload payload, store_->Take(name_));
  EXPECT_EQ(payload.View().Sha256(), name_);
}

TEST_F(UploadStoreTest, SyncsReceivedDataPeriodically) {
  Reopen({.sync_every = std::chrono::milliseconds(0)});
  ASSERT_THAT(store_->Begin(announcement_), IsOk());
  ASSERT_THAT(store_->Append(name_, 0, bytes_.substr(0, 5000)), IsOk());
  Reopen();
  ASSERT_OK_AND_ASSIGN(const int64_t committed, store_->Committed(name_));
  EXPECT_EQ(committed, 5000);
}

TEST_F(UploadStoreTest, RestartDropsDataAfterTheLastSync) {
  Reopen({.sync_every = std::chrono::hours(1)});
  ASSERT_THAT(store_->Begin(announcement_), IsOk());
  ASSERT_THAT(store_->Append(name_, 0, bytes_.substr(0, 5000)), IsOk());
  ASSERT_THAT(store_->Committed(name_), IsOk());
  ASSERT_THAT(store_->Append(name_, 5000, "what nobody has heard of yet"), IsOk());
  Reopen();
  ASSERT_OK_AND_ASSIGN(const int64_t committed, store_->Committed(name_));
  EXPECT_EQ(committed, 5000);
  EXPECT_EQ(std::filesystem::file_size(folder_ / "uploads/" + name_ + ".part"), 5000);
}

TEST_F(UploadStoreTest, DifferentAnnouncementOfTheSameNameRestartsTheUpload) {
  ASSERT_THAT(store_->Begin(announcement_), IsOk());
  ASSERT_THAT(store_->Append(name_, 0, bytes_.substr(0, 5000)), IsOk());
  UploadAnnouncement other = AnnouncementOf(SamplePayload(1, 100));
  other.sha256 = name_;
  ASSERT_OK_AND_ASSIGN(const int64_t committed, store_->Begin(other));
  EXPECT_EQ(committed, 0);
  ASSERT_OK_AND_ASSIGN(const UploadAnnouncement announced, store_->Announced(name_));
  EXPECT_EQ(announced.shape.num_vertices, 100);
}

TEST_F(UploadStoreTest, WrongOffsetsAreRefusedAndTheMessageSaysTheRightOne) {
  ASSERT_THAT(store_->Begin(announcement_), IsOk());
  ASSERT_THAT(store_->Append(name_, 0, "0123"), IsOk());
  for (const int64_t offset : {int64_t{0}, int64_t{3}, int64_t{5}, int64_t{-1}, INT64_MAX}) {
    EXPECT_THAT(store_->Append(name_, offset, "x"),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("4 bytes are committed")));
  }
  EXPECT_THAT(store_->Append(name_, 4, bytes_),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("it ends at")));
  EXPECT_THAT(store_->Read(name_).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("4 of")));
  EXPECT_THAT(store_->Take(name_).status(), StatusIs(absl::StatusCode::kFailedPrecondition));
  ASSERT_OK_AND_ASSIGN(const int64_t committed, store_->Committed(name_));
  EXPECT_EQ(committed, 4);
}

TEST_F(UploadStoreTest, NamesAndSizesThatCannotBeAreRefused) {
  UploadAnnouncement announcement = announcement_;
  announcement.sha256 = "../../../etc/passwd";
  EXPECT_THAT(store_->Begin(announcement), StatusIs(absl::StatusCode::kInvalidArgument));
  announcement = announcement_;
  ++announcement.total_bytes;
  EXPECT_THAT(store_->Begin(announcement), StatusIs(absl::StatusCode::kInvalidArgument));
  announcement.shape.num_vertices = -1;
  EXPECT_THAT(store_->Begin(announcement), StatusIs(absl::StatusCode::kInvalidArgument));
  announcement.shape.num_vertices = INT64_MAX;
  EXPECT_THAT(store_->Begin(announcement), StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_EQ(Files(), 0);
}

TEST_F(UploadStoreTest, AllPartsTogetherHaveALimit) {
  Reopen({.max_bytes = 10, .max_parts = 2});
  const UploadAnnouncement second = AnnouncementOf(SamplePayload(2));
  ASSERT_THAT(store_->Begin(announcement_), IsOk());
  ASSERT_THAT(store_->Begin(second), IsOk());
  EXPECT_THAT(
      store_->Begin(AnnouncementOf(SamplePayload(3))),
      StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("2 incomplete mesh uploads")));
  ASSERT_THAT(store_->Append(name_, 0, "012345"), IsOk());
  EXPECT_THAT(store_->Append(second.sha256, 0, "01234"),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("10 bytes")));
  Reopen({.max_bytes = 5, .max_parts = 2});
  ASSERT_THAT(store_->Drop(name_), IsOk());
  EXPECT_THAT(store_->Append(second.sha256, 0, "01234"), IsOk()) << "what was dropped is free";
}

TEST_F(UploadStoreTest, RemovesUnusablePartsAndKeepsTheRest) {
  for (int number = 1; number <= 4; ++number) {
    const MeshPayload mesh = SamplePayload(number, 2000);
    ASSERT_THAT(store_->Begin(AnnouncementOf(mesh)), IsOk());
    ASSERT_THAT(store_->Append(RecordOf(mesh).sha256, 0, BytesOf(mesh).substr(0, 100)), IsOk());
    ASSERT_THAT(store_->Committed(RecordOf(mesh).sha256), IsOk());
  }
  store_.reset();
  const auto path = [&](int number, const char* suffix) {
    return folder_ / "uploads/" + RecordOf(SamplePayload(number, 2000)).sha256 + suffix;
  };
  std::filesystem::remove(path(2, ".part"));
  std::filesystem::resize_file(path(3, ".announced"), 90);
  std::filesystem::resize_file(path(4, ".part"), 60);
  std::ofstream(folder_ / "uploads/stray.7.new") << "left by a crash";
  Reopen();
  EXPECT_THAT(store_->Committed(name_), IsOk());
  EXPECT_THAT(store_->Committed(RecordOf(SamplePayload(2, 2000)).sha256),
              StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(store_->Committed(RecordOf(SamplePayload(3, 2000)).sha256),
              StatusIs(absl::StatusCode::kNotFound));
  ASSERT_OK_AND_ASSIGN(const int64_t cut,
                       store_->Committed(RecordOf(SamplePayload(4, 2000)).sha256));
  EXPECT_EQ(cut, 60);
  EXPECT_EQ(Files(), 4) << "two parts with their announcements";
}

TEST_F(UploadStoreTest, OldPartsAreRemovedAndFreshOnesStay) {
  const MeshPayload fresh = SamplePayload(2);
  ASSERT_THAT(store_->Begin(announcement_), IsOk());
  ASSERT_THAT(store_->Begin(AnnouncementOf(fresh)), IsOk());
  const timespec old[2] = {{1000, 0}, {1000, 0}};
  ASSERT_EQ(utimensat(AT_FDCWD, (folder_ / "uploads/" + name_ + ".part").c_str(), old, 0), 0);
  ASSERT_OK_AND_ASSIGN(int removed, store_->RemoveOlderThan(1000));
  EXPECT_EQ(removed, 0);
  ASSERT_OK_AND_ASSIGN(removed, store_->RemoveOlderThan(1001));
  EXPECT_EQ(removed, 1);
  EXPECT_THAT(store_->Committed(name_), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(store_->Committed(RecordOf(fresh).sha256), IsOk());
  EXPECT_EQ(Files(), 2);
}

TEST_F(UploadStoreTest, RemovesTheOldestPartsWhenFullAndKeepsRecentOnes) {
  Reopen({.max_parts = 3});
  const std::string oldest = RecordOf(SamplePayload(2)).sha256;
  const std::string older = RecordOf(SamplePayload(3)).sha256;
  for (int number = 1; number <= 3; ++number) {
    ASSERT_THAT(store_->Begin(AnnouncementOf(SamplePayload(number))), IsOk());
  }
  const auto touch = [this](const std::string& name, int64_t at_s) {
    const timespec times[2] = {{at_s, 0}, {at_s, 0}};
    return utimensat(AT_FDCWD, (folder_ / "uploads/" + name + ".part").c_str(), times, 0);
  };
  ASSERT_THAT(store_->Append(older, 0, "0123456789"), IsOk());
  ASSERT_EQ(touch(oldest, 1000), 0);
  ASSERT_EQ(touch(older, 2000), 0);
  EXPECT_THAT(store_->Begin(AnnouncementOf(SamplePayload(4))), IsOk());
  EXPECT_THAT(store_->Committed(oldest), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(store_->Committed(older), IsOk());
  // A place there is, but not for its bytes.
  Reopen({.max_bytes = AnnouncementOf(SamplePayload(5)).total_bytes + 9, .max_parts = 4});
  ASSERT_EQ(touch(older, 2000), 0);
  EXPECT_THAT(store_->Begin(AnnouncementOf(SamplePayload(5))), IsOk());
  EXPECT_THAT(store_->Committed(older), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(store_->Committed(RecordOf(SamplePayload(1)).sha256), IsOk());
  EXPECT_EQ(Files(), 6);
}

TEST_F(UploadStoreTest, RefusesAllButOneStreamSendingTheSameBytes) {
  ASSERT_THAT(store_->Begin(announcement_), IsOk());
  std::vector<absl::Status> results(4);
  std::vector<std::thread> threads;
  threads.reserve(results.size());
  for (absl::Status& result : results) {
    threads.emplace_back([&, this] { result = store_->Append(name_, 0, bytes_); });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(std::count_if(results.begin(), results.end(), [](const auto& r) { return r.ok(); }), 1);
  ASSERT_OK_AND_ASSIGN(const MeshPayload payload, store_->Take(name_));
  EXPECT_EQ(payload.View().Sha256(), name_);
}

TEST(TemporaryUploadStoreTest, ItsFolderGoesWithIt) {
  std::string mine;
  {
    ASSERT_OK_AND_ASSIGN(const auto store, UploadStore::OpenTemporary());
    const MeshPayload mesh = SamplePayload(1);
    ASSERT_THAT(store->Begin(AnnouncementOf(mesh)), IsOk());
    ASSERT_THAT(store->Append(RecordOf(mesh).sha256, 0, BytesOf(mesh)), IsOk());
    for (const auto& entry :
         std::filesystem::directory_iterator(std::filesystem::temp_directory_path())) {
      if (std::filesystem::exists(entry.path() / (RecordOf(mesh).sha256 + ".part"))) {
        mine = entry.path();
      }
    }
    ASSERT_NE(mine, "");
    struct stat status {};
    ASSERT_EQ(stat(mine.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0700);
    EXPECT_THAT(store->Take(RecordOf(mesh).sha256).status(), IsOk());
  }
  EXPECT_FALSE(std::filesystem::exists(mine));
}

}  // namespace
}  // namespace tissueform
