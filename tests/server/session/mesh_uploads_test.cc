// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/mesh_uploads.h"

#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::Bar;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::SampleMesh;
using ::tissueform::testing::StatusIs;
using Code = absl::StatusCode;

class MeshUploadsTest : public ::testing::Test {
 protected:
  MeshUploadsTest() { Restart(); }
  ~MeshUploadsTest() override { std::filesystem::remove_all(folder_); }

  // What is not synced does not come back: the store takes up what its marks say.
  void Restart(const UploadLimits& limits = {}) {
    uploads_.reset();
    store_.reset();
    absl::StatusOr<std::unique_ptr<UploadStore>> store = UploadStore::Open(folder_, limits);
    ASSERT_THAT(store, IsOk());
    store_ = *std::move(store);
    uploads_ = std::make_unique<MeshUploads>(limits_, &catalog_, store_.get());
  }
  std::unique_ptr<MeshUpload> Open() {
    auto upload = uploads_->Open(announcement_);
    EXPECT_THAT(upload, IsOk());
    return *std::move(upload);
  }
  // Sends up to `end` and breaks off.
  void SendUpTo(int64_t end) {
    EXPECT_THAT(Open()->Write(0, payload_.substr(0, end), false), IsOk());
  }
  int64_t Committed() {
    const absl::StatusOr<UploadProgress> progress = uploads_->Query(announcement_.sha256);
    if (!progress.ok()) return -1;
    EXPECT_EQ(progress->total_bytes, announcement_.total_bytes);
    return progress->committed_bytes;
  }

  const std::string folder_ = absl::StrCat(::testing::TempDir(), "tissueform_uploads_", getpid());
  const SampleMesh sample_{Bar({2, 2, 3}, 1.0, 0.2)};
  const UploadAnnouncement announcement_ = sample_.Announcement();
  const std::string payload_ = sample_.Payload();
  const int64_t total_ = announcement_.total_bytes;
  ServiceLimits limits_;
  MemoryBudget budget_{64 << 20};
  MeshCatalog catalog_{limits_, &budget_};
  std::unique_ptr<UploadStore> store_;
  std::unique_ptr<MeshUploads> uploads_;
};

TEST_F(MeshUploadsTest, AMeshComesOutAsItWentInWhateverTheChunks) {
  for (const int64_t chunk_bytes : {int64_t{7}, int64_t{1000}, total_ - 1, total_}) {
    const std::unique_ptr<MeshUpload> upload = Open();
    for (int64_t offset = 0; offset < total_; offset += chunk_bytes) {
      ASSERT_THAT(upload->Write(offset, payload_.substr(offset, chunk_bytes),
                                offset + chunk_bytes >= total_),
                  IsOk());
    }
    EXPECT_EQ(budget_.reserved_bytes(), 0) << "nothing is held before it is whole";
    ASSERT_OK_AND_ASSIGN(auto stored, upload->Finish());
    EXPECT_EQ(stored->mesh.positions(), sample_.mesh.positions());
    EXPECT_EQ(stored->mesh.tets(), sample_.mesh.tets());
    EXPECT_EQ(stored->cell_arrays[0].values, sample_.cell_arrays[0].values);
    EXPECT_EQ(Committed(), -1) << "the part is gone";
    EXPECT_THAT(catalog_.Remove(stored->sha256), IsOk());
  }
}

TEST_F(MeshUploadsTest, ResumesAnInterruptedUploadAfterARestart) {
  SendUpTo(1000);
  Restart();
  EXPECT_EQ(Committed(), 1000);
  const std::unique_ptr<MeshUpload> upload = Open();
  EXPECT_EQ(upload->received_bytes(), 1000);
  ASSERT_THAT(upload->Write(1000, payload_.substr(1000), true), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto stored, upload->Finish());
  EXPECT_EQ(stored->mesh.positions(), sample_.mesh.positions());
}

TEST_F(MeshUploadsTest, WritingAtZeroRestartsTheUpload) {
  {
    const std::unique_ptr<MeshUpload> wrong = Open();
    ASSERT_THAT(wrong->Write(0, std::string(1000, 'x'), false), IsOk());
  }
  const std::unique_ptr<MeshUpload> upload = Open();
  ASSERT_THAT(upload->Write(0, payload_.substr(0, 10), false), IsOk());
  EXPECT_EQ(Committed(), 10);
  EXPECT_THAT(upload->Write(0, payload_, true), StatusIs(Code::kInvalidArgument)) << "once";
  ASSERT_THAT(upload->Write(10, payload_.substr(10), true), IsOk());
  EXPECT_THAT(upload->Finish(), IsOk());
}

TEST_F(MeshUploadsTest, ChunksOutOfPlaceAreRefusedAndNothingIsLost) {
  SendUpTo(1000);
  const auto refused = [this](int64_t offset, const std::string& data, bool last,
                              const char* text) {
    EXPECT_THAT(Open()->Write(offset, data, last),
                StatusIs(Code::kInvalidArgument, HasSubstr(text)));
    EXPECT_EQ(Committed(), 1000) << text;
  };
  refused(999, "x", false,
          "1000 bytes of this mesh are there; continue there, or start again at 0");
  refused(1001, "x", false, "begins at 1001");
  refused(-8, "x", false, "begins at -8");
  refused(INT64_MAX, "x", false, "1000 bytes");
  refused(1000, payload_.substr(999), true, "exceeds");
  refused(0, payload_ + "x", true, "exceeds");
  refused(1000, std::string((1 << 20) + 1, 'x'), false, "1048576 at most");
  refused(1000, "", true, "send the rest");
  const absl::Status out_of_place = Open()->Write(7, "x", false);
  EXPECT_TRUE(HasReason(out_of_place, ErrorReason::kChunkOutOfPlace));
  EXPECT_EQ(ErrorInfoOf(out_of_place).metadata.at("committed_bytes"), "1000");

  const std::unique_ptr<MeshUpload> upload = Open();
  ASSERT_THAT(upload->Write(1000, payload_.substr(1000, 10), false), IsOk());
  for (const int64_t offset : {0, 1000, 1009, 1011}) {
    EXPECT_THAT(upload->Write(offset, "x", false),
                StatusIs(Code::kInvalidArgument, HasSubstr("without gaps")));
  }
  EXPECT_EQ(Committed(), 1010);
}

TEST_F(MeshUploadsTest, ASecondUploadOfTheMeshIsRefusedAsLongAsTheFirstLives) {
  std::unique_ptr<MeshUpload> first = Open();
  const absl::Status second = uploads_->Open(announcement_).status();
  EXPECT_THAT(second, StatusIs(Code::kAborted, HasSubstr("another client")));
  EXPECT_TRUE(HasReason(second, ErrorReason::kUploadUnderWay));
  const SampleMesh other(Bar({2, 2, 4}));
  EXPECT_THAT(uploads_->Open(other.Announcement()), IsOk()) << "to another mesh";
  ASSERT_THAT(first->Write(0, payload_.substr(0, 10), false), IsOk());
  first.reset();
  EXPECT_EQ(Open()->received_bytes(), 10);
}

TEST_F(MeshUploadsTest, DifferentHeaderRestartsTheUpload) {
  SendUpTo(1000);
  UploadAnnouncement other = SampleMesh(Bar({2, 2, 4})).Announcement();
  other.sha256 = announcement_.sha256;
  {
    ASSERT_OK_AND_ASSIGN(const auto upload, uploads_->Open(other));
    EXPECT_EQ(upload->received_bytes(), 0);
    ASSERT_THAT(upload->Write(0, "0123", false), IsOk());
    ASSERT_OK_AND_ASSIGN(const UploadProgress progress, uploads_->Query(other.sha256));
    EXPECT_EQ(progress.total_bytes, other.total_bytes);
  }
  EXPECT_EQ(Open()->received_bytes(), 0);
}

TEST_F(MeshUploadsTest, AnUploadWithoutAByteLeavesNoPart) {
  Open();
  EXPECT_EQ(Committed(), -1);
  Restart({.max_bytes = 1 << 20, .max_parts = 1});
  Open();
  EXPECT_THAT(uploads_->Open(SampleMesh(Bar({2, 2, 4})).Announcement()), IsOk());
}

TEST_F(MeshUploadsTest, WrongBytesAreDropped) {
  std::string damaged = payload_;
  damaged[1234] ^= 1;
  {
    const std::unique_ptr<MeshUpload> upload = Open();
    ASSERT_THAT(upload->Write(0, damaged, true), IsOk());
    EXPECT_THAT(upload->Finish(), StatusIs(Code::kDataLoss, HasSubstr("SHA-256")));
    EXPECT_EQ(Committed(), -1);
  }
  EXPECT_EQ(budget_.reserved_bytes(), 0);
  EXPECT_EQ(Open()->received_bytes(), 0);
}

TEST_F(MeshUploadsTest, DropsAnUnusableMesh) {
  SampleMesh broken = sample_;
  broken.cell_arrays[0].values[7] = std::numeric_limits<double>::quiet_NaN();
  ASSERT_OK_AND_ASSIGN(const auto upload, uploads_->Open(broken.Announcement()));
  ASSERT_THAT(upload->Write(0, broken.Payload(), true), IsOk());
  EXPECT_THAT(upload->Finish(), StatusIs(Code::kInvalidArgument, HasSubstr("tet 7")));
  EXPECT_THAT(uploads_->Query(broken.Announcement().sha256), StatusIs(Code::kNotFound));
}

TEST_F(MeshUploadsTest, WithoutRoomInMemoryThePartStaysAndTheEndIsEnough) {
  ASSERT_OK_AND_ASSIGN(auto others, budget_.Reserve((64 << 20) - 1000, "others"));
  {
    const std::unique_ptr<MeshUpload> upload = Open();
    ASSERT_THAT(upload->Write(0, payload_, true), IsOk());
    EXPECT_THAT(upload->Finish(), StatusIs(Code::kResourceExhausted));
  }
  EXPECT_EQ(Committed(), total_);
  others = MemoryReservation();
  Restart();
  const std::unique_ptr<MeshUpload> upload = Open();
  ASSERT_THAT(upload->Write(total_, "", true), IsOk());
  EXPECT_THAT(upload->Finish(), IsOk());
  EXPECT_EQ(Committed(), -1);
}

TEST_F(MeshUploadsTest, ExceedingTheStoresLimitsKeepsTheEarlierPart) {
  Restart({.max_bytes = 1500, .max_parts = 1});
  {
    const std::unique_ptr<MeshUpload> upload = Open();
    ASSERT_THAT(upload->Write(0, payload_.substr(0, 1000), false), IsOk());
    EXPECT_THAT(upload->Write(1000, payload_.substr(1000, 1000), false),
                StatusIs(Code::kResourceExhausted, HasSubstr("1500 bytes")));
    EXPECT_THAT(uploads_->Open(SampleMesh(Bar({2, 2, 4})).Announcement()),
                StatusIs(Code::kResourceExhausted, HasSubstr("incomplete mesh uploads")));
  }
  EXPECT_EQ(Committed(), 1000);
}

TEST_F(MeshUploadsTest, InvalidAnnouncementsReserveNothing) {
  UploadAnnouncement wrong = announcement_;
  ++wrong.total_bytes;
  EXPECT_THAT(uploads_->Open(wrong), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(uploads_->Query(wrong.sha256), StatusIs(Code::kNotFound));
  EXPECT_EQ(Open()->received_bytes(), 0) << "and leave the mesh to others";
}

}  // namespace
}  // namespace tissueform
