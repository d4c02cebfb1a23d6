// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/builds/build_files.h"

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/payload/sha256.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using Code = absl::StatusCode;

class BuildFilesTest : public ::testing::Test {
 protected:
  void SetUp() override { Open(); }
  void Open() {
    files_.reset();
    auto opened = BuildFiles::Open(folder_, limits_, [this] { return now_s_; });
    ASSERT_THAT(opened, IsOk());
    files_ = *std::move(opened);
  }

  BuildFileRecord Announce(const std::string& owner = "ann") const {
    return {.sha256 = Sha256Hex({bytes_}),
            .owner = owner,
            .suffix = ".nrrd",
            .total_bytes = static_cast<int64_t>(bytes_.size())};
  }
  std::string sha256() const { return Sha256Hex({bytes_}); }
  int CountFiles() const {
    return static_cast<int>(std::distance(std::filesystem::directory_iterator(folder_), {}));
  }

  const std::string folder_ = EmptyTestFolder("build_files").string() + "/files";
  const std::string bytes_ = std::string(70'000, 'x') + "the end";
  PlanBuildLimits limits_;
  int64_t now_s_ = 1'000'000;
  std::unique_ptr<BuildFiles> files_;
};

TEST_F(BuildFilesTest, AnUploadGoesOnAfterARestart) {
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord file, files_->Begin(Announce()));
  ASSERT_THAT(files_->Append(file, 0, bytes_.substr(0, 40'000)), IsOk());
  ASSERT_THAT(files_->Commit(file), IsOk());
  Open();
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord again, files_->Begin(Announce()));
  EXPECT_EQ(again.committed_bytes, 40'000);
  ASSERT_THAT(files_->Append(again, 40'000, bytes_.substr(40'000)), IsOk());
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord whole, files_->Commit(again));
  EXPECT_TRUE(whole.is_whole());
  const std::string goal = folder_ + "/../linked.nrrd";
  ASSERT_THAT(files_->Link("ann", sha256(), goal), IsOk());
  std::ifstream linked(goal, std::ios::binary);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(linked), {}), bytes_);
}

TEST_F(BuildFilesTest, AWholeFileIsKnownAfterARestart) {
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord file, files_->Begin(Announce()));
  ASSERT_THAT(files_->Append(file, 0, bytes_), IsOk());
  // Its digest was not asked for before the server ended.
  Open();
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord found, files_->Find("ann", sha256()));
  EXPECT_THAT(files_->Link("ann", sha256(), folder_ + "/../early"),
              StatusIs(Code::kFailedPrecondition));
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord whole, files_->Commit(found));
  EXPECT_TRUE(whole.is_whole());
  Open();
  EXPECT_THAT(files_->Link("ann", sha256(), folder_ + "/../late"), IsOk());
}

TEST_F(BuildFilesTest, OtherBytesAreDropped) {
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord file, files_->Begin(Announce()));
  std::string damaged = bytes_;
  damaged[1234] = 'y';
  ASSERT_THAT(files_->Append(file, 0, damaged), IsOk());
  EXPECT_THAT(files_->Commit(file), StatusIs(Code::kDataLoss, HasSubstr("send the file again")));
  EXPECT_THAT(files_->Find("ann", sha256()), StatusIs(Code::kNotFound));
  EXPECT_EQ(CountFiles(), 0);
}

TEST_F(BuildFilesTest, AnotherPrincipalStartsFromZero) {
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord file, files_->Begin(Announce()));
  ASSERT_THAT(files_->Append(file, 0, bytes_), IsOk());
  EXPECT_THAT(files_->Find("bob", sha256()), StatusIs(Code::kNotFound));
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord of_bob, files_->Begin(Announce("bob")));
  EXPECT_EQ(of_bob.committed_bytes, 0);
  ASSERT_THAT(files_->Remove("bob", sha256()), IsOk());
  EXPECT_THAT(files_->Find("ann", sha256()), IsOk());
}

TEST_F(BuildFilesTest, AdoptedFileBelongsToItsAdopter) {
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord file, files_->Begin(Announce()));
  EXPECT_THAT(files_->Adopt("ann", sha256(), "bob"), StatusIs(Code::kFailedPrecondition));
  ASSERT_THAT(files_->Append(file, 0, bytes_), IsOk());
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord adopted, files_->Adopt("ann", sha256(), "bob"));
  EXPECT_EQ(adopted.owner, "bob");
  EXPECT_TRUE(adopted.is_whole());
  ASSERT_THAT(files_->Remove("ann", sha256()), IsOk());
  Open();
  ASSERT_OK_AND_ASSIGN(const OpenFile opened, files_->OpenWhole("bob", sha256()));
  ASSERT_OK_AND_ASSIGN(const std::string bytes, opened.ReadAt(0, 100'000));
  EXPECT_EQ(bytes, bytes_);
  EXPECT_THAT(files_->OpenWhole("ann", sha256()), StatusIs(Code::kNotFound));
}

TEST_F(BuildFilesTest, AdoptedFileReplacesAnInterruptedUpload) {
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord of_bob, files_->Begin(Announce("bob")));
  ASSERT_THAT(files_->Append(of_bob, 0, "broken"), IsOk());
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord file, files_->Begin(Announce()));
  ASSERT_THAT(files_->Append(file, 0, bytes_), IsOk());
  ASSERT_THAT(files_->Adopt("ann", sha256(), "bob"), IsOk());
  // An upload that goes on, or another one of the same name, changes nothing of ann's file.
  EXPECT_THAT(files_->Append(of_bob, 6, "x"), StatusIs(Code::kInvalidArgument));
  BuildFileRecord other = Announce("bob");
  other.suffix = ".mha";
  ASSERT_THAT(files_->Begin(other), IsOk());
  ASSERT_OK_AND_ASSIGN(const OpenFile opened, files_->OpenWhole("ann", sha256()));
  EXPECT_EQ(*opened.Size(), static_cast<int64_t>(bytes_.size()));
}

TEST_F(BuildFilesTest, RefusesInvalidInputFiles) {
  BuildFileRecord dicom = Announce();
  dicom.suffix = ".dcm";
  EXPECT_THAT(files_->Begin(dicom), StatusIs(Code::kInvalidArgument, HasSubstr("DICOM")));
  BuildFileRecord empty = Announce();
  empty.total_bytes = 0;
  EXPECT_THAT(files_->Begin(empty), StatusIs(Code::kInvalidArgument));
  BuildFileRecord nameless = Announce();
  nameless.sha256 = "../../etc/passwd";
  EXPECT_THAT(files_->Begin(nameless), StatusIs(Code::kInvalidArgument));
}

TEST_F(BuildFilesTest, ChunksFollowEachOther) {
  ASSERT_OK_AND_ASSIGN(const BuildFileRecord file, files_->Begin(Announce()));
  ASSERT_THAT(files_->Append(file, 0, "abc"), IsOk());
  EXPECT_THAT(files_->Append(file, 2, "d"),
              StatusIs(Code::kInvalidArgument, HasSubstr("3 bytes are committed")));
  EXPECT_THAT(files_->Append(file, 3, bytes_), StatusIs(Code::kInvalidArgument));
}

TEST_F(BuildFilesTest, LimitsHold) {
  limits_.max_file_bytes = 1'000;
  Open();
  EXPECT_THAT(files_->Begin(Announce()),
              StatusIs(Code::kResourceExhausted, HasSubstr("--max-build-file-mib")));
  limits_.max_file_bytes = 100'000;
  limits_.max_files_bytes = 100'000;
  Open();
  ASSERT_THAT(files_->Begin(Announce()), IsOk());
  EXPECT_THAT(files_->Begin(Announce("bob")), StatusIs(Code::kResourceExhausted));
}

TEST_F(BuildFilesTest, FilesGoWhenTheirTimeIsOver) {
  ASSERT_THAT(files_->Begin(Announce()), IsOk());
  ASSERT_THAT(files_->Begin(Announce("bob")), IsOk());
  now_s_ += limits_.retention_hours * 3600 - 1;
  const auto needed = [](const std::string& owner, const std::string&) { return owner == "bob"; };
  EXPECT_EQ(files_->RemoveExpired(needed), 0);
  now_s_ += 1;
  EXPECT_EQ(files_->RemoveExpired(needed), 1);
  EXPECT_THAT(files_->Find("ann", sha256()), StatusIs(Code::kNotFound));
  EXPECT_THAT(files_->Find("bob", sha256()), IsOk());
}

TEST_F(BuildFilesTest, RemovesADamagedUploadOnOpening) {
  ASSERT_THAT(files_->Begin(Announce()), IsOk());
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (entry.path().extension() == ".about") std::ofstream(entry.path()) << "damaged";
  }
  Open();
  EXPECT_EQ(CountFiles(), 0);
  EXPECT_THAT(files_->Find("ann", sha256()), StatusIs(Code::kNotFound));
}

}  // namespace
}  // namespace tissueform::testing
