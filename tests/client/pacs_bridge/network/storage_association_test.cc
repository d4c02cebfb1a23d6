// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/storage_association.h"

#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/pacs_bridge/network/storage_receiver.h"
#include "tests/client/pacs_bridge/network/cut_wire.h"
#include "tests/client/pacs_bridge/network/dicom_peers.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

// What DCMTK's and GDCM's programs send, whole and broken off.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::SizeIs;

constexpr char kJpeg2000Lossless[] = "1.2.840.10008.1.2.4.90";

class StorageAssociationTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasProgram("storescu")) GTEST_SKIP() << "storescu is absent: install dcmtk";
    std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    for (char& c : name) c = c == '/' ? '_' : c;
    sent_ = EmptyTestFolder(absl::StrCat("associated_", name));
    received_ = EmptyTestFolder(absl::StrCat("association_", name));
    folder_ = *InstanceFolder::Open({.path = received_, .watermark_bytes = 0});
    ReceiverOptions options;
    options.calling_ae_titles = {"SCANNER"};
    auto receiver = StorageReceiver::Start(options, folder_.get(), &sink_);
    ASSERT_THAT(receiver.status(), IsOk());
    receiver_ = *std::move(receiver);
  }

  static ProgramEnd Send(int port, const std::vector<std::string>& files,
                         const std::string& syntax) {
    std::vector<std::string> arguments = {"-v",         "-aet", "SCANNER",   "-aec",
                                          "TISSUEFORM", syntax, "127.0.0.1", absl::StrCat(port)};
    arguments.insert(arguments.end(), files.begin(), files.end());
    return RunPeer("storescu", arguments);
  }

  size_t CountReceived() const {
    return static_cast<size_t>(
        std::distance(fs::directory_iterator(received_), fs::directory_iterator()));
  }

  fs::path sent_;
  fs::path received_;
  RecordingSink sink_;
  std::unique_ptr<InstanceFolder> folder_;
  std::unique_ptr<StorageReceiver> receiver_;
};

TEST_F(StorageAssociationTest, Jpeg2000IsKeptAsItIs) {
  if (!HasProgram("gdcmconv")) GTEST_SKIP() << "gdcmconv is absent: install libgdcm-tools";
  const CtSeries series = WriteCtSeries(sent_, {.slices = 2});
  std::vector<std::string> compressed;
  for (const std::string& file : series.files) {
    compressed.push_back(absl::StrCat(file, ".j2k"));
    const ProgramEnd end = RunPeer("gdcmconv", {"--j2k", file, compressed.back()});
    ASSERT_EQ(end.exit_code, 0) << end.said;
  }
  const ProgramEnd end = Send(receiver_->port(), compressed, "-xv");
  EXPECT_EQ(end.exit_code, 0) << end.said;
  const auto instances = sink_.instances();
  ASSERT_THAT(instances, SizeIs(2));
  for (size_t i = 0; i < instances.size(); ++i) {
    EXPECT_EQ(instances[i].header.transfer_syntax_uid, kJpeg2000Lossless);
    EXPECT_EQ(DataSetOfFile(instances[i].path), DataSetOfFile(compressed[i]));
  }
}

class BrokenTransferTest : public StorageAssociationTest,
                           public ::testing::WithParamInterface<WireEnd> {};

TEST_P(BrokenTransferTest, KeepsCompleteInstancesAndNoPartialOnes) {
  CtSeriesOptions large;
  large.slices = 3;
  large.rows = 512;
  large.columns = 512;
  const CtSeries series = WriteCtSeries(sent_, large);
  const auto one = static_cast<int64_t>(fs::file_size(series.files[0]));
  {
    const CutWire wire(receiver_->port(), one + one / 2, GetParam());
    EXPECT_NE(Send(wire.port(), series.files, "-xe").exit_code, 0);
  }
  const auto ends = sink_.WaitForEnds(1);
  ASSERT_THAT(ends, SizeIs(1));
  EXPECT_FALSE(ends[0].released);
  EXPECT_NE(ends[0].problem, "");
  EXPECT_EQ(ends[0].kept, 1);
  ASSERT_THAT(sink_.instances(), SizeIs(1));
  EXPECT_EQ(DataSetOfFile(sink_.instances()[0].path), DataSetOfFile(series.files[0]));
  EXPECT_EQ(CountReceived(), 1) << "nothing half is left";
  EXPECT_EQ(Send(receiver_->port(), series.files, "-xe").exit_code, 0);
  EXPECT_EQ(CountReceived(), 3) << "and the sender may send all again";
}

INSTANTIATE_TEST_SUITE_P(Ends, BrokenTransferTest,
                         ::testing::Values(WireEnd::kClosed, WireEnd::kAborted),
                         [](const auto& test) {
                           return test.param == WireEnd::kClosed ? "Closed" : "Aborted";
                         });

}  // namespace
}  // namespace tissueform::testing
