// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/pacs_client.h"
#include "tests/client/pacs_bridge/network/dicom_peers.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

// A PACS that does not offer everything.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

PacsPeer PeerAt(int port, const std::string& title) {
  PacsPeer peer;
  peer.name = "pacs";
  peer.host = "127.0.0.1";
  peer.port = port;
  peer.ae_title = title;
  return peer;
}

// DCMTK's archive with C-FIND and C-MOVE and no C-GET.
class FindAndMoveTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasProgram("dcmqrscp")) GTEST_SKIP() << "dcmqrscp is absent: install dcmtk";
    fs::create_directories(home_ / "area");
    const int port = FreePort();
    WriteTestFile(
        home_ / "config",
        absl::StrCat("NetworkTCPPort = ", port,
                     "\nMaxPDUSize = 16384\nMaxAssociations = 16\nHostTable BEGIN\nHostTable END\n"
                     "VendorTable BEGIN\nVendorTable END\nAETable BEGIN\nARCHIVE ",
                     (home_ / "area").string(), " RW (100, 1024mb) ANY\nAETable END\n"));
    ChildOptions options;
    options.program = "dcmqrscp";
    options.arguments = {"--disable-get", "--config", (home_ / "config").string()};
    options.output = ChildStream::File(home_ / "log");
    options.errors = ChildStream::File(home_ / "log");
    auto started = GuardedProgram::Start(options, std::chrono::milliseconds(200));
    ASSERT_THAT(started.status(), IsOk());
    archive_ = *std::move(started);
    ASSERT_TRUE(WaitForPort(port)) << BytesOfFile(home_ / "log");
    client_ = *MakePacsClient(PeerAt(port, "ARCHIVE"));
  }

  const fs::path home_ = EmptyTestFolder("find_and_move");
  std::unique_ptr<GuardedProgram> archive_;
  std::unique_ptr<PacsClient> client_;
};

TEST_F(FindAndMoveTest, AStudysPatientIsFoundAlthoughNoHeaderComes) {
  fs::create_directories(home_ / "sent");
  CtSeriesOptions options;
  options.slices = 1;
  options.character_set = "ISO_IR 100";
  options.patient_name = "M\xFCller^Maria";
  const CtSeries series = WriteCtSeries(home_ / "sent", options);
  const auto stored = client_->Store(series.files);
  ASSERT_THAT(stored.status(), IsOk());
  ASSERT_THAT(stored->at(0).status, IsOk());
  EXPECT_THAT(client_->FetchHeader(series.study_uid, series.series_uid, home_ / "header"),
              StatusIs(absl::StatusCode::kUnimplemented, HasSubstr("does not offer the service")));
  EXPECT_FALSE(fs::exists(home_ / "header"));
  const auto patient = client_->FindPatient(series.study_uid);
  ASSERT_THAT(patient.status(), IsOk());
  EXPECT_EQ(patient->name, "Müller^Maria");
  EXPECT_EQ(patient->id, options.patient_id);
  EXPECT_TRUE(patient->readable);
  EXPECT_THAT(client_->FindPatient(NewDicomUid()).status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such study")));
}

}  // namespace
}  // namespace tissueform::testing
