// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/storage_receiver.h"

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"
#include <arpa/inet.h>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "tests/client/pacs_bridge/network/dicom_peers.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

// A receiver on a free port, its folder and its sink; and storescu of DCMTK.
class StorageReceiverTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasProgram("storescu")) GTEST_SKIP() << "storescu is absent: install dcmtk";
    const std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    sent_ = EmptyTestFolder(absl::StrCat("sent_", name));
    folder_options_.path = EmptyTestFolder(absl::StrCat("received_", name));
    folder_options_.watermark_bytes = 0;
    options_.calling_ae_titles = {"SCANNER"};
  }

  void Start() {
    auto folder = InstanceFolder::Open(folder_options_);
    ASSERT_THAT(folder.status(), IsOk());
    folder_ = *std::move(folder);
    auto receiver = StorageReceiver::Start(options_, folder_.get(), &sink_);
    ASSERT_THAT(receiver.status(), IsOk());
    receiver_ = *std::move(receiver);
  }

  ProgramEnd Send(const std::vector<std::string>& files, std::vector<std::string> options = {}) {
    std::vector<std::string> arguments = {"-v", "-aet", "SCANNER", "-aec", "TISSUEFORM"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    arguments.insert(arguments.end(), {"127.0.0.1", absl::StrCat(receiver_->port())});
    arguments.insert(arguments.end(), files.begin(), files.end());
    return RunPeer("storescu", arguments);
  }

  std::vector<fs::path> Received() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder_options_.path)) files.push_back(entry);
    return files;
  }

  fs::path sent_;
  InstanceFolderOptions folder_options_;
  ReceiverOptions options_;
  RecordingSink sink_;
  std::unique_ptr<InstanceFolder> folder_;
  std::unique_ptr<StorageReceiver> receiver_;
};

TEST_F(StorageReceiverTest, AnObjectThatIsTooLargeIsNotToBeSentAgain) {
  folder_options_.limits.max_file_bytes = 1000;
  Start();
  const ProgramEnd end = Send(WriteCtSeries(sent_, {.slices = 1}).files);
  EXPECT_THAT(end.said, HasSubstr("Error: CannotUnderstand"));
  EXPECT_THAT(Received(), IsEmpty());
}

TEST(ConformanceStatement, NamesEveryStorageClassThatIsTaken) {
  const std::string statement = BytesOfFile(SourcePath("docs/dicom-storage-classes.csv"));
  for (int i = 0; i < numberOfDcmAllStorageSOPClassUIDs; ++i) {
    const std::string uid = dcmAllStorageSOPClassUIDs[i];
    EXPECT_THAT(statement,
                HasSubstr(absl::StrCat("\n", uid, ",", dcmFindNameOfUID(uid.c_str(), "?"), "\n")));
  }
}

TEST_F(StorageReceiverTest, StoresASeriesBitIdenticallyUnderNeutralNames) {
  Start();
  CtSeriesOptions options;
  options.private_text = std::string(20'000, 'x');
  const CtSeries series = WriteCtSeries(sent_, options);
  const ProgramEnd end = Send(series.files, {"-xe"});
  EXPECT_EQ(end.exit_code, 0) << end.said;
  const auto ends = sink_.WaitForEnds(1);
  ASSERT_THAT(ends, SizeIs(1));
  EXPECT_EQ(ends[0].kept, 8);
  EXPECT_TRUE(ends[0].released);
  EXPECT_EQ(ends[0].problem, "");
  const auto instances = sink_.instances();
  ASSERT_THAT(instances, SizeIs(8));
  for (size_t i = 0; i < instances.size(); ++i) {
    EXPECT_EQ(instances[i].header.instance_uid, series.instance_uids[i]);
    EXPECT_EQ(instances[i].calling_ae, "SCANNER");
    EXPECT_EQ(instances[i].association, ends[0].association);
    EXPECT_EQ(DataSetOfFile(instances[i].path), DataSetOfFile(series.files[i]));
    EXPECT_THAT(instances[i].path, Not(HasSubstr(series.instance_uids[i])));
    EXPECT_EQ(fs::status(instances[i].path).permissions(),
              fs::perms::owner_read | fs::perms::owner_write);
  }
  EXPECT_THAT(Received(), SizeIs(8));
}

TEST_F(StorageReceiverTest, EchoIsAnswered) {
  Start();
  const ProgramEnd end = RunPeer("echoscu", {"-aet", "SCANNER", "-aec", "TISSUEFORM", "127.0.0.1",
                                             absl::StrCat(receiver_->port())});
  EXPECT_EQ(end.exit_code, 0) << end.said;
}

TEST_F(StorageReceiverTest, WrongAndUnknownTitlesAndAddressesAreRefused) {
  options_.addresses = {"127.0.0.1"};
  Start();
  const CtSeries series = WriteCtSeries(sent_, {.slices = 1});
  EXPECT_THAT(Send(series.files, {"-aet", "STRANGER"}).said,
              HasSubstr("Calling AE Title Not Recognized"));
  EXPECT_THAT(Send(series.files, {"-aec", "OTHER"}).said,
              HasSubstr("Called AE Title Not Recognized"));
  EXPECT_THAT(Received(), IsEmpty());
  options_.addresses = {"10.0.0.0/8"};
  Start();
  EXPECT_NE(Send(series.files).exit_code, 0);
  EXPECT_THAT(Received(), IsEmpty());
  EXPECT_EQ(receiver_->Counts().refused, 1);
  EXPECT_THAT(sink_.WaitForRefusals(3), ElementsAre("127.0.0.1 STRANGER: unknown calling AE title",
                                                    "127.0.0.1 SCANNER: wrong called AE title",
                                                    "127.0.0.1 : unknown address"));
}

TEST_F(StorageReceiverTest, AtTheWatermarkTheSenderReceivesOutOfResources) {
  folder_options_.watermark_bytes = int64_t{1} << 60;
  Start();
  const ProgramEnd end = Send(WriteCtSeries(sent_, {.slices = 2}).files, {"+v", "-d"});
  EXPECT_THAT(end.said, HasSubstr("0xa700"));
  const auto ends = sink_.WaitForEnds(1);
  ASSERT_THAT(ends, SizeIs(1));
  EXPECT_EQ(ends[0].kept, 0);
  EXPECT_THAT(ends[0].problem, HasSubstr("free some space"));
  EXPECT_THAT(Received(), IsEmpty());
}

TEST_F(StorageReceiverTest, InstanceThatTheSinkRefusesIsRemoved) {
  Start();
  sink_.Answer(absl::InternalError("the queue is shut"));
  const ProgramEnd end = Send(WriteCtSeries(sent_, {.slices = 1}).files, {"-d"});
  EXPECT_THAT(end.said, HasSubstr("0x0110"));
  EXPECT_THAT(Received(), IsEmpty());
}

TEST_F(StorageReceiverTest, DuplicateIsKeptOnceAndChangedInstanceSeparately) {
  Start();
  const CtSeries series = WriteCtSeries(sent_, {.slices = 1});
  EXPECT_EQ(Send(series.files).exit_code, 0);
  EXPECT_EQ(Send(series.files).exit_code, 0);
  DcmFileFormat file;
  file.loadFile(series.files[0].c_str());
  file.getDataset()->putAndInsertString(DCM_PatientID, "MERGED-1");
  file.saveFile(series.files[0].c_str());
  EXPECT_EQ(Send(series.files).exit_code, 0);
  const auto instances = sink_.instances();
  ASSERT_THAT(instances, SizeIs(3));
  EXPECT_EQ(instances[0].novelty, ReceivedInstance::Novelty::kNew);
  EXPECT_EQ(instances[1].novelty, ReceivedInstance::Novelty::kReplayed);
  EXPECT_EQ(instances[1].path, instances[0].path);
  EXPECT_EQ(instances[2].novelty, ReceivedInstance::Novelty::kChanged);
  EXPECT_NE(instances[2].path, instances[0].path);
  EXPECT_EQ(instances[2].header.patient_id, "MERGED-1");
  EXPECT_THAT(Received(), SizeIs(2));
}

TEST_F(StorageReceiverTest, NamesOfAHundredThousandCharactersAndOfOtherSetsAreKeptAsTheyAre) {
  Start();
  CtSeriesOptions options;
  options.slices = 1;
  options.patient_name = std::string(100'000, 'N');
  const CtSeries endless = WriteCtSeries(sent_, options);
  EXPECT_EQ(Send(endless.files, {"-xe"}).exit_code, 0);
  ASSERT_THAT(sink_.instances(), SizeIs(1));
  EXPECT_THAT(sink_.instances()[0].header.text_problem, HasSubstr("(0010,0010)"));
  EXPECT_EQ(DataSetOfFile(sink_.instances()[0].path), DataSetOfFile(endless.files[0]));
  options.character_set = "\\ISO 2022 IR 87";
  options.patient_name = "Yamada^Tarou=\x1B$B;3ED\x1B(B^\x1B$BB@O:\x1B(B";
  const CtSeries japanese = WriteCtSeries(sent_, options);
  EXPECT_EQ(Send(japanese.files, {"-xe"}).exit_code, 0);
  ASSERT_THAT(sink_.instances(), SizeIs(2));
  EXPECT_EQ(sink_.instances()[1].header.patient_name, "Yamada^Tarou=山田^太郎");
  EXPECT_EQ(DataSetOfFile(sink_.instances()[1].path), DataSetOfFile(japanese.files[0]));
}

TEST_F(StorageReceiverTest, MixedPatientsInOneAssociationAreReportedSeparately) {
  Start();
  CtSeriesOptions other;
  other.patient_id = "OTHER";
  fs::create_directory(sent_ / "other");
  std::vector<std::string> files = WriteCtSeries(sent_, {.slices = 2}).files;
  const CtSeries second = WriteCtSeries(sent_ / "other", other);
  files.push_back(second.files[0]);
  EXPECT_EQ(Send(files).exit_code, 0);
  std::set<std::string> patients;
  std::set<int64_t> associations;
  for (const ReceivedInstance& instance : sink_.instances()) {
    patients.insert(instance.header.patient_id);
    associations.insert(instance.association);
  }
  EXPECT_THAT(patients, SizeIs(2));
  EXPECT_THAT(associations, SizeIs(1));
}

TEST_F(StorageReceiverTest, AbortedAssociationKeepsTheReceivedInstances) {
  Start();
  const CtSeries series = WriteCtSeries(sent_);
  Send(series.files, {"--abort"});
  const auto ends = sink_.WaitForEnds(1);
  ASSERT_THAT(ends, SizeIs(1));
  EXPECT_FALSE(ends[0].released);
  EXPECT_THAT(ends[0].problem, HasSubstr("aborted"));
  EXPECT_EQ(static_cast<size_t>(ends[0].kept), sink_.instances().size());
  EXPECT_THAT(Received(), SizeIs(8));
}

// A connection that says nothing.
class Silent {
 public:
  explicit Silent(int port) : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in place = {};
    place.sin_family = AF_INET;
    place.sin_port = htons(static_cast<uint16_t>(port));
    place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = connect(socket_, reinterpret_cast<sockaddr*>(&place), sizeof(place)) == 0;
  }
  ~Silent() { close(socket_); }
  Silent(const Silent&) = delete;
  Silent& operator=(const Silent&) = delete;
  bool connected() const { return connected_; }
  // Until the other end closes: what it said.
  std::string ReadAll() {
    std::string text;
    char piece[512];
    for (ssize_t count; (count = read(socket_, piece, sizeof(piece))) > 0;)
      text.append(piece, static_cast<size_t>(count));
    return text;
  }
  void Say(const std::string& bytes) { EXPECT_GE(write(socket_, bytes.data(), bytes.size()), 0); }

 private:
  const int socket_;
  bool connected_ = false;
};

TEST_F(StorageReceiverTest, SilentConnectionsDoNotBlockOthers) {
  Start();
  const Silent one(receiver_->port());
  const Silent other(receiver_->port());
  ASSERT_TRUE(one.connected() && other.connected());
  EXPECT_EQ(Send(WriteCtSeries(sent_, {.slices = 1}).files).exit_code, 0);
}

TEST_F(StorageReceiverTest, ClosesASilentConnection) {
  options_.connect_time = std::chrono::seconds(1);
  Start();
  Silent one(receiver_->port());
  EXPECT_EQ(one.ReadAll(), "");
  EXPECT_EQ(receiver_->Counts().kept, 0);
}

TEST_F(StorageReceiverTest, RandomBytesEndTheirConnectionAlone) {
  options_.connect_time = std::chrono::seconds(1);
  Start();
  const std::string broken = "127.0.0.1 : no valid association request, or TLS failed";
  for (const std::string& bytes :
       {std::string("GET / HTTP/1.1\r\n\r\n"), std::string("\x01\x00\xFF\xFF\xFF\xFF", 6),
        std::string("\x01\x00\x00\x00\x00\x04gurk", 10), std::string(5000, '\x02')}) {
    Silent one(receiver_->port());
    one.Say(bytes);
    one.ReadAll();
  }
  // DCMTK takes the last one for a request.
  EXPECT_THAT(sink_.WaitForRefusals(4),
              ElementsAre(broken, broken, broken, "127.0.0.1 : unknown application context"));
  EXPECT_EQ(Send(WriteCtSeries(sent_, {.slices = 1}).files).exit_code, 0);
}

TEST_F(StorageReceiverTest, TwentyAssociationsAreServedAtOnce) {
  Start();
  std::vector<CtSeries> all;
  for (int i = 0; i < 20; ++i) {
    fs::create_directory(sent_ / absl::StrCat(i));
    all.push_back(WriteCtSeries(sent_ / absl::StrCat(i), {.slices = 2}));
  }
  std::vector<std::thread> senders;
  senders.reserve(all.size());
  std::atomic<int> good = 0;
  for (const CtSeries& series : all) {
    senders.emplace_back([&] { good += Send(series.files).exit_code == 0 ? 1 : 0; });
  }
  for (std::thread& sender : senders) sender.join();
  EXPECT_EQ(good, 20);
  EXPECT_THAT(Received(), SizeIs(40));
}

TEST_F(StorageReceiverTest, BeyondTheLimitAnAssociationIsRefusedForNow) {
  options_.max_associations = 1;
  Start();
  const Silent one(receiver_->port());
  ASSERT_TRUE(one.connected());
  const ProgramEnd end = Send(WriteCtSeries(sent_, {.slices = 1}).files);
  EXPECT_NE(end.exit_code, 0);
  EXPECT_THAT(end.said, HasSubstr("Local Limit Exceeded"));
  EXPECT_THAT(end.said, HasSubstr("Rejected Transient"));
  EXPECT_THAT(sink_.WaitForRefusals(1),
              ElementsAre("127.0.0.1 SCANNER: too many associations are open"));
}

TEST_F(StorageReceiverTest, StoppingClosesOpenConnections) {
  Start();
  Silent one(receiver_->port());
  ASSERT_TRUE(one.connected());
  receiver_->Stop();
  EXPECT_EQ(one.ReadAll(), "");
}

TEST(StorageReceiver, InvalidOptionsAreReported) {
  RecordingSink sink;
  const auto folder = InstanceFolder::Open({.path = EmptyTestFolder("receiver_options").string()});
  ASSERT_THAT(folder.status(), IsOk());
  const auto started = [&](const ReceiverOptions& options) {
    return StorageReceiver::Start(options, folder->get(), &sink).status();
  };
  EXPECT_THAT(started({.addresses = {"pacs.example"}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("write 10.1.2.3")));
  EXPECT_THAT(started({.ae_title = "SEVENTEENLETTERS!"}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 to 16 ASCII characters")));
  EXPECT_THAT(started({.calling_ae_titles = {"SCANNER", "A\\B"}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("without a backslash")));
  EXPECT_THAT(started({.address = "nowhere"}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("address and port")));
  const auto first = StorageReceiver::Start({}, folder->get(), &sink);
  ASSERT_THAT(first.status(), IsOk());
  EXPECT_THAT(
      started({.port = (*first)->port()}),
      StatusIs(absl::StatusCode::kUnavailable, HasSubstr("in use; choose another --listen")));
}

}  // namespace
}  // namespace tissueform::testing
