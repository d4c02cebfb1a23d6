// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/server/store/disk_recorder.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/store_workload.h"
#include "tests/server/store/stores_case.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

// A disk that loses power. One run of the workload is recorded, down to its writes and syncs; then
// the disk is made again as it was at a moment, without what had not been synced, and the store is
// opened from it. A sync is taken out by leaving it out of the replay.
namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

constexpr int kSteps = kStepsOfARound + 6;
constexpr int64_t kOpened = -1;  // the mark of a store that is open
constexpr size_t kOpsLookedAt = 80;

bool IsSync(const DiskOp& op) {
  return op.kind == DiskOp::Kind::kSyncFile || op.kind == DiskOp::Kind::kSyncFolder;
}

class PowerCutTest : public ::testing::Test {
 protected:
  // Records the run once, and finds the syncs that have something to do: the others change nothing.
  static void SetUpTestSuite() {
    const ScratchFolder scratch;
    const std::string root = scratch / "disk";
    std::filesystem::create_directory(root);
    StartRecording(root);
    {
      auto store = DurableStore::Open(*DataFolder::Open(root + "/data"));
      ASSERT_THAT(store.status(), IsOk());
      MarkRecording(kOpened);
      for (int number = 0; number < kSteps; ++number) {
        ASSERT_THAT(RunStep(number, /*bursts=*/false, **store), IsOk()) << number;
        MarkRecording(number);
      }
      ops = StopRecording();
    }
    DiskImage image;
    for (size_t i = 0; i < ops.size(); ++i) {
      if (IsSync(ops[i])) {
        if (!image.HasWorkFor(ops[i])) continue;
        syncs.insert(i);
      }
      if (ops[i].kind == DiskOp::Kind::kMark && ops[i].offset == kOpened) opened_at = i;
      image.Apply(ops[i]);
    }
  }

  // What the store says after a cut before ops[cut], of a disk that did not do the syncs `without`.
  static absl::Status AfterCut(size_t cut, DiskImage::Kept kept, const std::set<size_t>& without) {
    DiskImage image;
    int acknowledged_steps = 0;
    bool opened = false;
    for (size_t i = 0; i < cut; ++i) {
      if (ops[i].kind == DiskOp::Kind::kMark) {
        opened = true;
        acknowledged_steps = static_cast<int>(ops[i].offset + 1);
      }
      if (!IsSync(ops[i]) || (syncs.count(i) > 0 && without.count(i) == 0)) image.Apply(ops[i]);
    }
    StoreModel acknowledged;
    for (int number = 0; number < acknowledged_steps; ++number)
      ApplyStep(number, /*bursts=*/false, &acknowledged);
    StoreModel begun = acknowledged;
    const bool just_answered = cut > 0 && ops[cut - 1].kind == DiskOp::Kind::kMark;
    if (opened && !just_answered && acknowledged_steps < kSteps)
      ApplyStep(acknowledged_steps, /*bursts=*/false, &begun);
    const ScratchFolder disk("/dev/shm");
    image.WriteAfterCut(disk.path(), kept);
    const absl::Status erased = CheckErased(acknowledged, disk / "data");
    if (!erased.ok()) return erased;
    auto folder = DataFolder::Open(disk / "data");
    if (!folder.ok()) return folder.status();
    const auto store = DurableStore::Open(*std::move(folder));
    return store.ok() ? CheckAgainst(acknowledged, begun, **store) : store.status();
  }

  // Whether some cut shows that these syncs are missing. First those just after an answer, where
  // most are seen.
  static bool IsMissed(const std::set<size_t>& without) {
    const size_t first = *without.begin() + 1;
    for (size_t cut = first; cut <= ops.size(); ++cut) {
      const bool after_answer = ops[cut - 1].kind == DiskOp::Kind::kMark;
      if (after_answer && !AfterCut(cut, DiskImage::Kept::kNothing, without).ok()) return true;
    }
    const size_t end = std::min(ops.size(), *without.rbegin() + kOpsLookedAt);
    for (size_t cut = first; cut <= end; ++cut) {
      if (!AfterCut(cut, DiskImage::Kept::kNothing, without).ok()) return true;
      if (!AfterCut(cut, DiskImage::Kept::kLastOfEachFile, without).ok()) return true;
    }
    return false;
  }

  static std::vector<DiskOp> ops;
  static std::set<size_t> syncs;  // in ops
  static size_t opened_at;
};

std::vector<DiskOp> PowerCutTest::ops;
std::set<size_t> PowerCutTest::syncs;
size_t PowerCutTest::opened_at = 0;

TEST_F(PowerCutTest, TheRecorderSeesEveryFile) {
  std::set<std::string> written;
  for (const DiskOp& op : ops) {
    if (op.kind == DiskOp::Kind::kWrite) written.insert(op.path.substr(0, op.path.find('.')));
  }
  for (const char* path : {"data/lock", "data/tissueform"}) EXPECT_EQ(written.count(path), 1U);
  EXPECT_GE(written.size(), 2 + 4 + 2U) << "four blobs and two uploads";
  EXPECT_GE(syncs.size(), 40U);
  // All that was written, and nothing else: the disk as it is when everything has been synced.
  DiskImage image;
  for (const DiskOp& op : ops) image.Apply(op);
  for (const DiskOp& op : ops) {
    if (op.kind == DiskOp::Kind::kCreate)
      image.Apply({.kind = DiskOp::Kind::kSyncFile, .file = op.file});
  }
  for (const char* folder : {"", "data", "data/blobs", "data/uploads"}) {
    image.Apply({.kind = DiskOp::Kind::kSyncFolder, .path = folder});
  }
  const ScratchFolder disk;
  image.WriteAfterCut(disk.path(), DiskImage::Kept::kNothing);
  const auto store = DurableStore::Open(*DataFolder::Open(disk / "data"));
  ASSERT_THAT(store.status(), IsOk());
  StoreModel model;
  for (int number = 0; number < kSteps; ++number) ApplyStep(number, /*bursts=*/false, &model);
  EXPECT_THAT(CheckAgainst(model, model, **store), IsOk());
}

TEST_F(PowerCutTest, AcknowledgedDataSurvivesACutAtAnyOperation) {
  for (size_t cut = 0; cut <= ops.size(); ++cut) {
    ASSERT_THAT(AfterCut(cut, DiskImage::Kept::kNothing, {}), IsOk()) << cut;
    ASSERT_THAT(AfterCut(cut, DiskImage::Kept::kLastOfEachFile, {}), IsOk()) << cut;
  }
}

// SQLite syncs the header of a log before its first frame. It matters where the frames of an older
// log lie behind it; ours are always emptied, and then the commit's own sync is all that is needed.
bool IsHeaderOfEmptyLog(const DiskOp& before) {
  return before.kind == DiskOp::Kind::kWrite && absl::EndsWith(before.path, "-wal") &&
         before.offset == 0;
}

// Before it writes its log into the database SQLite syncs it, which a deletion's commit has just
// done: take one out, and the other does its work.
bool IsDoneTwice(const DiskOp& sync, const DiskOp& next) {
  return IsSync(next) && next.file == sync.file && next.path == sync.path;
}

TEST_F(PowerCutTest, EverySyncIsNeeded) {
  int taken_out = 0;
  for (const size_t sync : syncs) {
    if (sync < opened_at || IsHeaderOfEmptyLog(ops[sync - 1])) continue;
    if (sync + 1 < ops.size() && IsDoneTwice(ops[sync], ops[sync + 1])) continue;
    EXPECT_TRUE(IsMissed({sync})) << "the sync of \"" << ops[sync].path << "\", operation " << sync;
    ++taken_out;
  }
  EXPECT_GE(taken_out, 30);
}

// Until the store is open nothing is promised, so syncs of one folder are taken out together; those
// of files protect nothing yet.
TEST_F(PowerCutTest, EveryFolderSyncOfTheStartIsNeeded) {
  std::map<std::string, std::set<size_t>> folders;
  for (const size_t sync : syncs) {
    if (sync < opened_at && ops[sync].kind == DiskOp::Kind::kSyncFolder) {
      folders[ops[sync].path].insert(sync);
    }
  }
  EXPECT_EQ(folders.size(), 2U) << "what holds the data folder, and the data folder";
  for (const auto& [path, without] : folders) EXPECT_TRUE(IsMissed(without)) << path;
}

TEST(FullDiskTest, RefusesWritesOnAFullDiskAndKeepsServing) {
  for (const int64_t room : {0, 100, 3000, 20000}) {
    const ScratchFolder scratch;
    const std::string path = scratch / "data";
    StoreModel model;
    {
      const auto store = DurableStore::Open(*DataFolder::Open(path));
      ASSERT_THAT(store.status(), IsOk());
      for (int number = 0; number < kStepsOfARound; ++number) {
        ASSERT_THAT(RunStep(number, /*bursts=*/true, **store), IsOk());
        ApplyStep(number, /*bursts=*/true, &model);
      }
      LimitDisk(path, room);
      StoreModel begun = model;
      absl::Status status;
      for (int number = kStepsOfARound; status.ok() && number < 3 * kStepsOfARound; ++number) {
        ApplyStep(number, /*bursts=*/true, &begun);
        status = RunStep(number, /*bursts=*/true, **store);
        if (status.ok()) model = begun;
      }
      EXPECT_THAT(status, StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("is full")));
      LimitDisk(path, -1);
      EXPECT_THAT(CheckAgainst(model, begun, **store), IsOk()) << room;
      EXPECT_THAT(CreateSession((*store)->sessions(), SampleSession("later", 1)), IsOk());
      EXPECT_THAT(DeleteSession((*store)->sessions(), "later"), IsOk());
    }
    const auto store = DurableStore::Open(*DataFolder::Open(path));
    ASSERT_THAT(store.status(), IsOk());
    EXPECT_THAT((*store)->damaged(), IsEmpty());
  }
}

TEST(FullDiskTest, ReportsADiskTooFullForAStore) {
  const ScratchFolder scratch;
  auto folder = DataFolder::Open(scratch / "data");
  ASSERT_THAT(folder, IsOk());
  LimitDisk(scratch / "data", 0);
  EXPECT_THAT(DurableStore::Open(*std::move(folder)).status(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("free some space")));
  EXPECT_THAT(DataFolder::Open(scratch / "data").status(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("free some space")));
  LimitDisk(scratch / "data", -1);
  const auto store = DurableStore::Open(*DataFolder::Open(scratch / "data"));
  EXPECT_THAT(store.status(), IsOk()) << "nothing half-made is in the way";
}

TEST(BrokenDiskTest, NothingIsAcknowledgedThatCouldNotBeSynced) {
  const ScratchFolder scratch;
  const std::string path = scratch / "data";
  const auto store = DurableStore::Open(*DataFolder::Open(path));
  ASSERT_THAT(store.status(), IsOk());
  StoreModel model;
  ApplyStep(0, /*bursts=*/true, &model);
  ASSERT_THAT(RunStep(0, /*bursts=*/true, **store), IsOk());
  const MeshPayload mesh = SamplePayload(1);
  UploadStore& uploads = (*store)->uploads();
  const UploadAnnouncement announcement = AnnouncementOf(mesh);
  ASSERT_THAT(uploads.Begin(announcement), IsOk());
  ASSERT_THAT(uploads.Append(announcement.sha256, 0, "0123"), IsOk());
  BreakSyncs(path, true);
  EXPECT_FALSE(CreateSession((*store)->sessions(), SampleSession("lost", 1)).ok());
  EXPECT_FALSE((*store)->meshes().Put(RecordOf(mesh), mesh.View()).ok());
  EXPECT_FALSE((*store)->predictions().Create(SamplePrediction("p"), SamplePositions(1)).ok());
  EXPECT_FALSE(uploads.Committed(announcement.sha256).ok());
  BreakSyncs(path, false);
  EXPECT_THAT(uploads.Committed(announcement.sha256),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("start it again")))
      << "a later sync says nothing of what the first has lost";
  ASSERT_OK_AND_ASSIGN(const int64_t committed, uploads.Begin(announcement));
  EXPECT_EQ(committed, 0);
  EXPECT_THAT(CheckAgainst(model, model, **store), IsOk()) << "nothing of it is there";
  EXPECT_THAT((*store)->meshes().Put(RecordOf(mesh), mesh.View()), IsOk());
}

TEST(ReadOnlyDiskTest, AFolderThatCannotBeWrittenIsRefused) {
  const ScratchFolder scratch;
  MakeDiskReadOnly(scratch.path(), true);
  EXPECT_THAT(DataFolder::Open(scratch / "data").status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("read-only")));
  MakeDiskReadOnly(scratch.path(), false);
  ASSERT_THAT(DataFolder::Open(scratch / "data").status(), IsOk());
  MakeDiskReadOnly(scratch.path(), true);
  EXPECT_THAT(DataFolder::Open(scratch / "data").status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("read-only")));
  MakeDiskReadOnly(scratch.path(), false);
}

}  // namespace
}  // namespace tissueform
