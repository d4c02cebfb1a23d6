// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/tls_layer.h"

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/pacs_bridge/network/storage_receiver.h"
#include "tests/client/pacs_bridge/network/dicom_peers.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TlsFiles FilesOf(const TestFiles& files) { return {files.certificate, files.key, files.roots}; }

// A receiver with TLS, and storescu with what it is given.
class TlsReceiverTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasProgram("storescu")) GTEST_SKIP() << "storescu is absent: install dcmtk";
    const std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    keys_ = EmptyTestFolder(absl::StrCat("keys_", name));
    const fs::path received = EmptyTestFolder(absl::StrCat("tls_received_", name));
    files_ = WriteCtSeries(EmptyTestFolder(absl::StrCat("tls_sent_", name)), {.slices = 2}).files;
    auto folder = InstanceFolder::Open({.path = received, .watermark_bytes = 0});
    ASSERT_THAT(folder.status(), IsOk());
    folder_ = *std::move(folder);
    ReceiverOptions options;
    options.calling_ae_titles = {"SCANNER"};
    options.tls = FilesOf(authority_.IssueFiles(keys_, "bridge"));
    options.connect_time = std::chrono::seconds(2);
    auto receiver = StorageReceiver::Start(options, folder_.get(), &sink_);
    ASSERT_THAT(receiver.status(), IsOk());
    receiver_ = *std::move(receiver);
  }

  ProgramEnd Send(const std::vector<std::string>& options) {
    std::vector<std::string> arguments = {"-v", "-aet", "SCANNER", "-aec", "TISSUEFORM"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    arguments.insert(arguments.end(), {"127.0.0.1", absl::StrCat(receiver_->port())});
    arguments.insert(arguments.end(), files_.begin(), files_.end());
    return RunPeer("storescu", arguments);
  }

  static std::vector<std::string> As(const TestFiles& files) {
    return {"+tls", files.key, files.certificate, "+cf", files.roots};
  }

  const TestAuthority authority_;
  fs::path keys_;
  std::vector<std::string> files_;
  RecordingSink sink_;
  std::unique_ptr<InstanceFolder> folder_;
  std::unique_ptr<StorageReceiver> receiver_;
};

TEST_F(TlsReceiverTest, APeerOfTheAuthorityIsServed) {
  const ProgramEnd end = Send(As(authority_.IssueFiles(keys_, "scanner")));
  EXPECT_EQ(end.exit_code, 0) << end.said;
  EXPECT_THAT(sink_.instances(), SizeIs(2));
}

TEST_F(TlsReceiverTest, PlainAnonymousExpiredAndForeignPeersAreRefused) {
  EXPECT_NE(Send({}).exit_code, 0);
  const TestFiles good = authority_.IssueFiles(keys_, "scanner");
  EXPECT_NE(Send({"+tla", "+cf", good.roots}).exit_code, 0);
  const TestFiles expired = authority_.IssueFiles(
      keys_, "expired", {.begins = std::chrono::hours(-48), .ends = std::chrono::hours(-24)});
  EXPECT_NE(Send(As(expired)).exit_code, 0);
  const TestAuthority stranger("Another authority");
  TestFiles foreign = stranger.IssueFiles(keys_, "foreign");
  foreign.roots = good.roots;
  EXPECT_NE(Send(As(foreign)).exit_code, 0);
  EXPECT_THAT(sink_.instances(), IsEmpty());
  // The peer may have ended before the receiver counts it.
  for (int i = 0; i < 1000 && receiver_->Counts().refused < 4; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(receiver_->Counts().refused, 4);
  EXPECT_EQ(Send(As(good)).exit_code, 0);
}

TEST(TlsLayer, NamesMismatchedFiles) {
  const TestAuthority authority;
  const fs::path keys = EmptyTestFolder("tls_layer_files");
  const TlsFiles good = FilesOf(authority.IssueFiles(keys, "good"));
  EXPECT_THAT(MakeTlsLayer(good, TlsRole::kReceiver).status(), IsOk());
  EXPECT_THAT(MakeTlsLayer(good, TlsRole::kSender, "localhost").status(), IsOk());
  TlsFiles mixed = good;
  mixed.key = authority.IssueFiles(keys, "other").key;
  EXPECT_THAT(MakeTlsLayer(mixed, TlsRole::kReceiver).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("good.pem")));
  TlsFiles missing = good;
  missing.authorities = keys / "none.pem";
  EXPECT_THAT(MakeTlsLayer(missing, TlsRole::kReceiver).status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.pem")));
  EXPECT_THAT(MakeTlsLayer({}, TlsRole::kSender).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--dicom-cert")));
  fs::permissions(good.key, fs::perms::others_read, fs::perm_options::add);
  EXPECT_THAT(MakeTlsLayer(good, TlsRole::kReceiver).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("good.key")));
}

}  // namespace
}  // namespace tissueform::testing
