// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/pacs_client.h"

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/storage_receiver.h"
#include "core/imaging/series/image_header.h"
#include "tests/client/pacs_bridge/network/dicom_peers.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

constexpr char kDicomWebPlugin[] = "/usr/share/orthanc/plugins/libOrthancDicomWeb.so";

struct PeerKind {
  std::string called;
  PacsPeer::Kind kind = PacsPeer::Kind::kDimse;
  PacsPeer::Fetch fetch = PacsPeer::Fetch::kGet;
  bool secure = false;
};

// Orthanc on ports of its own, with a client of ours to it and a receiver that it knows.
class PacsClientTest : public ::testing::TestWithParam<PeerKind> {
 protected:
  void SetUp() override {
    if (!HasProgram("Orthanc")) GTEST_SKIP() << "Orthanc is absent: install orthanc";
    if (GetParam().kind == PacsPeer::Kind::kDicomWeb && !fs::exists(kDicomWebPlugin)) {
      GTEST_SKIP() << "DICOMweb of Orthanc is absent: install orthanc-dicomweb";
    }
    if (GetParam().kind == PacsPeer::Kind::kDicomWeb && GetParam().secure &&
        !HasProgram("/usr/sbin/haproxy")) {
      GTEST_SKIP() << "HAProxy is absent: install haproxy";
    }
    std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    for (char& c : name) c = c == '/' ? '_' : c;
    home_ = EmptyTestFolder(absl::StrCat("orthanc_", name));
    fs::create_directories(home_ / "keys");
    fs::create_directories(home_ / "received");
    fs::create_directories(home_ / "sent");
    folder_ = *InstanceFolder::Open({.path = home_ / "received", .watermark_bytes = 0});
    if (GetParam().secure) {
      files_ = authority_.IssueFiles(home_ / "keys", "bridge");
      peer_.tls = TlsFiles{files_->certificate, files_->key, files_->roots};
    }
    ReceiverOptions options;
    options.calling_ae_titles = {"ORTHANC"};
    options.tls = peer_.tls;
    auto receiver = StorageReceiver::Start(options, folder_.get(), &sink_);
    ASSERT_THAT(receiver.status(), IsOk());
    receiver_ = *std::move(receiver);
    StartOrthanc();
    auto client = MakePacsClient(peer_);
    ASSERT_THAT(client.status(), IsOk());
    client_ = *std::move(client);
  }

  void StartOrthanc() {
    const int http = FreePort();
    const int dicom = FreePort();
    int https = http;
    nlohmann::json config = {
        {"Name", "test"},
        {"StorageDirectory", home_ / "store"},
        {"IndexDirectory", home_ / "store"},
        {"TemporaryDirectory", home_},
        {"HttpPort", http},
        {"DicomPort", dicom},
        {"DicomAet", "ORTHANC"},
        {"DicomCheckCalledAet", true},
        {"RemoteAccessAllowed", true},  // of clients of loopback with certificates too
        {"AuthenticationEnabled", false},
        {"DicomAlwaysAllowGet", true},
        {"DicomAlwaysAllowFind", true},
        {"DicomAlwaysAllowMove", true},
        {"DicomScpTimeout", 10},
        {"DicomModalities",
         {{"tissueform",
           {{"AET", "TISSUEFORM"},
            {"Host", "127.0.0.1"},
            {"Port", receiver_->port()},
            {"UseDicomTls", GetParam().secure}}}}}};
    if (GetParam().kind == PacsPeer::Kind::kDicomWeb) {
      config["Plugins"] = {kDicomWebPlugin};
      config["DicomWeb"] = {{"Enable", true}, {"Root", "/dicom-web/"}};
    }
    if (GetParam().secure) {
      const TestFiles own = authority_.IssueFiles(home_ / "keys", "orthanc");
      WriteTestFile(home_ / "keys/both.pem", BytesOfFile(own.certificate) + BytesOfFile(own.key));
      config["DicomTlsEnabled"] = true;
      config["DicomTlsCertificate"] = own.certificate;
      config["DicomTlsPrivateKey"] = own.key;
      config["DicomTlsTrustedCertificates"] = own.roots;
      if (GetParam().kind == PacsPeer::Kind::kDicomWeb) https = StartHaproxy(http, own.roots);
    }
    WriteTestFile(home_ / "orthanc.json", config.dump());
    ChildOptions options;
    options.program = HasProgram("/usr/sbin/Orthanc") ? "/usr/sbin/Orthanc" : "Orthanc";
    options.arguments = {(home_ / "orthanc.json").string()};
    options.output = ChildStream::File(home_ / "log");
    options.errors = ChildStream::File(home_ / "log");
    auto started = GuardedProgram::Start(options, std::chrono::milliseconds(200));
    ASSERT_THAT(started.status(), IsOk());
    orthanc_ = *std::move(started);
    ASSERT_TRUE(WaitForPort(http) && WaitForPort(dicom)) << BytesOfFile(home_ / "log");
    peer_.name = "orthanc";
    peer_.kind = GetParam().kind;
    peer_.fetch = GetParam().fetch;
    peer_.host = "127.0.0.1";
    peer_.port = dicom;
    peer_.ae_title = "ORTHANC";
    peer_.url =
        absl::StrCat(GetParam().secure ? "https" : "http", "://127.0.0.1:", https, "/dicom-web/");
  }

  // TLS before Orthanc, whose own HTTPS crashes in Debian 12 at the first handshake. Asks clients
  // for certificates.
  int StartHaproxy(int http, const std::string& authorities) {
    const int https = FreePort();
    WriteTestFile(home_ / "haproxy.cfg",
                  absl::StrCat("defaults\n mode http\n timeout connect 5s\n timeout client 20s\n",
                               " timeout server 20s\nfrontend f\n bind 127.0.0.1:", https,
                               " ssl crt ", (home_ / "keys/both.pem").string(), " ca-file ",
                               authorities, " verify required\n default_backend b\nbackend b\n",
                               " server s 127.0.0.1:", http, "\n"));
    ChildOptions options;
    options.program = "/usr/sbin/haproxy";
    options.arguments = {"-f", (home_ / "haproxy.cfg").string()};
    options.output = ChildStream::File(home_ / "haproxy.log");
    options.errors = ChildStream::File(home_ / "haproxy.log");
    auto started = GuardedProgram::Start(options, std::chrono::milliseconds(200));
    EXPECT_THAT(started.status(), IsOk());
    if (started.ok()) haproxy_ = *std::move(started);
    EXPECT_TRUE(WaitForPort(https)) << BytesOfFile(home_ / "haproxy.log");
    return https;
  }

  const TestAuthority authority_;
  fs::path home_;
  std::optional<TestFiles> files_;
  RecordingSink sink_;
  std::unique_ptr<InstanceFolder> folder_;
  std::unique_ptr<StorageReceiver> receiver_;
  std::unique_ptr<GuardedProgram> haproxy_;
  std::unique_ptr<GuardedProgram> orthanc_;
  PacsPeer peer_;
  std::unique_ptr<PacsClient> client_;
};

// A header comes by C-GET, not by C-MOVE.
class PacsHeaderTest : public PacsClientTest {};
class TlsPacsClientTest : public PacsClientTest {};
class WebPacsClientTest : public PacsClientTest {};

TEST_P(PacsClientTest, StoredSeriesIsFoundAndReturnsBitIdentical) {
  CtSeriesOptions options;
  options.slices = 3;
  options.character_set = "ISO_IR 100";
  options.series_description =
      "Sch\xE4"
      "del";
  options.private_text = "private";
  const CtSeries series = WriteCtSeries(home_ / "sent", options);

  const auto before = client_->Has(series.study_uid, series.series_uid, series.instance_uids[1]);
  ASSERT_THAT(before.status(), IsOk());
  EXPECT_FALSE(*before);
  EXPECT_THAT(client_->FindSeries({.study_uid = series.study_uid}).status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such study")));

  const auto stored = client_->Store(series.files);
  ASSERT_THAT(stored.status(), IsOk());
  ASSERT_THAT(*stored, SizeIs(3));
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_THAT((*stored)[i].status, IsOk());
    EXPECT_EQ((*stored)[i].instance_uid, series.instance_uids[i]);
  }
  const auto after = client_->Has(series.study_uid, series.series_uid, series.instance_uids[1]);
  ASSERT_THAT(after.status(), IsOk());
  EXPECT_TRUE(*after);

  for (const SeriesQuery& query : {SeriesQuery{.study_uid = series.study_uid},
                                   SeriesQuery{.accession_number = options.accession_number}}) {
    const auto found = client_->FindSeries(query);
    ASSERT_THAT(found.status(), IsOk());
    ASSERT_THAT(*found, SizeIs(1));
    EXPECT_EQ((*found)[0].study_uid, series.study_uid);
    EXPECT_EQ((*found)[0].series_uid, series.series_uid);
    EXPECT_EQ((*found)[0].modality, "CT");
    EXPECT_EQ((*found)[0].description, "Schädel");
    EXPECT_EQ((*found)[0].number, 2);
    EXPECT_EQ((*found)[0].instances, 3);
    EXPECT_EQ((*found)[0].patient_id, options.patient_id);
  }

  const auto patient = client_->FindPatient(series.study_uid);
  ASSERT_THAT(patient.status(), IsOk());
  EXPECT_EQ(patient->name, options.patient_name);
  EXPECT_EQ(patient->id, options.patient_id);
  EXPECT_THAT(patient->birth_date, ::testing::AnyOf("", options.birth_date));
  EXPECT_THAT(patient->issuer, ::testing::AnyOf("", options.issuer_of_patient_id));
  EXPECT_TRUE(patient->readable);
  EXPECT_THAT(client_->FindPatient(NewDicomUid()).status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such study")));

  const auto fetched =
      client_->FetchSeries(series.study_uid, series.series_uid, folder_.get(), &sink_);
  ASSERT_THAT(fetched.status(), IsOk());
  EXPECT_EQ(fetched->completed, 3);
  EXPECT_EQ(fetched->failed, 0);
  ASSERT_THAT(sink_.instances(), SizeIs(3));
  for (const ReceivedInstance& instance : sink_.instances()) {
    const size_t number = static_cast<size_t>(instance.header.instance_number.value() - 1);
    EXPECT_EQ(DataSetOfFile(instance.path), DataSetOfFile(series.files[number]));
  }
}

TEST_P(PacsHeaderTest, AHeaderComesWithoutPixels) {
  const CtSeries series = WriteCtSeries(home_ / "sent", {.slices = 2});
  ASSERT_THAT(client_->Store(series.files).status(), IsOk());
  ASSERT_THAT(client_->FetchHeader(series.study_uid, series.series_uid, home_ / "header"), IsOk());
  const auto header = LoadDicomHeader(home_ / "header");
  ASSERT_THAT(header.status(), IsOk());
  EXPECT_FALSE((*header)->getDataset()->tagExists(DCM_PixelData));
  EXPECT_TRUE((*header)->getDataset()->tagExists(DCM_PatientBirthDate));
  EXPECT_EQ(fs::status(home_ / "header").permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
  for (const auto& entry : fs::directory_iterator(home_)) {
    EXPECT_THAT(entry.path().string(), Not(HasSubstr(".fetch-")));
  }
  EXPECT_THAT(client_->FetchHeader(series.study_uid, NewDicomUid(), home_ / "none"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such series")));
}

TEST_P(PacsHeaderTest, FetchesTheHeaderOfASliceFromASeriesWithCaptures) {
  CtSeriesOptions options{.study_uid = NewDicomUid(), .series_uid = NewDicomUid()};
  options.slices = 1;
  const CtSeries slice = WriteCtSeries(home_ / "sent", options);
  fs::create_directories(home_ / "captures");
  options.class_uid = std::string(kColourCaptureClass);
  options.slices = 5;
  const CtSeries captures = WriteCtSeries(home_ / "captures", options);
  for (const auto& files : {captures.files, slice.files, captures.files}) {
    ASSERT_THAT(client_->Store(files).status(), IsOk());
  }
  ASSERT_THAT(client_->FetchHeader(slice.study_uid, slice.series_uid, home_ / "header"), IsOk());
  EXPECT_EQ(ReadInstanceHeader(home_ / "header")->class_uid, kCtImageClass);
}

TEST_P(TlsPacsClientTest, RequiresTrustedCertificatesOnBothSides) {
  const TestAuthority stranger("Another authority");
  TestFiles foreign = stranger.IssueFiles(home_ / "keys", "foreign");
  peer_.tls = TlsFiles{foreign.certificate, foreign.key, files_->roots};
  EXPECT_FALSE((*MakePacsClient(peer_))->FindPatient(NewDicomUid()).ok());
  // The other way round: a peer that we cannot trust.
  peer_.tls = TlsFiles{files_->certificate, files_->key, foreign.roots};
  EXPECT_THAT((*MakePacsClient(peer_))->FindPatient(NewDicomUid()).status(),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("'orthanc'")));
}

TEST_P(WebPacsClientTest, ObjectThatTheDiskRefusesIsNotStored) {
  const CtSeries series = WriteCtSeries(home_ / "sent", {.slices = 1});
  // Files where Orthanc wants to have folders: it answers 200 although it keeps nothing.
  std::vector<fs::path> in_the_way;
  for (int i = 0; i < 256; ++i) {
    in_the_way.push_back(home_ / "store" / absl::StrCat(absl::Hex(i, absl::kZeroPad2)));
    WriteTestFile(in_the_way.back(), "");
  }
  const auto refused = client_->Store(series.files);
  ASSERT_THAT(refused.status(), IsOk());
  EXPECT_THAT((*refused)[0].status,
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr(series.instance_uids[0])));
  for (const fs::path& file : in_the_way) fs::remove(file);
  const auto stored = client_->Store(series.files);
  ASSERT_THAT(stored.status(), IsOk());
  EXPECT_THAT((*stored)[0].status, IsOk());
  const auto again = client_->Store(series.files);
  ASSERT_THAT(again.status(), IsOk());
  EXPECT_THAT((*again)[0].status, IsOk()) << "it has it already";
}

TEST_P(PacsClientTest, ReportsAStoppedPacsAsUnavailable) {
  haproxy_.reset();
  orthanc_.reset();
  EXPECT_THAT(client_->FindPatient(NewDicomUid()).status(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("'orthanc'")));
  const CtSeries series = WriteCtSeries(home_ / "sent", {.slices = 1});
  EXPECT_THAT(client_->Store(series.files).status().ok()
                  ? client_->Store(series.files)->at(0).status
                  : client_->Store(series.files).status(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("'orthanc'")));
}

const PeerKind kGet = {"DimseGet"};
const PeerKind kMove = {"DimseMove", PacsPeer::Kind::kDimse, PacsPeer::Fetch::kMove};
const PeerKind kWeb = {"DicomWeb", PacsPeer::Kind::kDicomWeb};
const PeerKind kGetTls = {"DimseGetTls", PacsPeer::Kind::kDimse, PacsPeer::Fetch::kGet, true};
const PeerKind kMoveTls = {"DimseMoveTls", PacsPeer::Kind::kDimse, PacsPeer::Fetch::kMove, true};
const PeerKind kWebTls = {"DicomWebTls", PacsPeer::Kind::kDicomWeb, PacsPeer::Fetch::kGet, true};

std::string NameOfKind(const ::testing::TestParamInfo<PeerKind>& kind) { return kind.param.called; }

INSTANTIATE_TEST_SUITE_P(All, PacsClientTest,
                         ::testing::Values(kGet, kMove, kWeb, kGetTls, kMoveTls, kWebTls),
                         NameOfKind);
INSTANTIATE_TEST_SUITE_P(All, PacsHeaderTest, ::testing::Values(kGet, kWeb, kGetTls, kWebTls),
                         NameOfKind);
INSTANTIATE_TEST_SUITE_P(All, TlsPacsClientTest, ::testing::Values(kGetTls, kWebTls), NameOfKind);
INSTANTIATE_TEST_SUITE_P(All, WebPacsClientTest, ::testing::Values(kWeb), NameOfKind);

TEST(PacsClient, WrongTitlesAreDistinguished) {
  RecordingSink sink;
  const fs::path received = EmptyTestFolder("client_titles");
  const auto folder = *InstanceFolder::Open({.path = received, .watermark_bytes = 0});
  ReceiverOptions options;
  options.calling_ae_titles = {"FRIEND"};
  const auto receiver = StorageReceiver::Start(options, folder.get(), &sink);
  ASSERT_THAT(receiver.status(), IsOk());
  PacsPeer peer;
  peer.name = "other";
  peer.host = "127.0.0.1";
  peer.port = (*receiver)->port();
  peer.ae_title = "TISSUEFORM";
  peer.own_ae_title = "STRANGER";
  EXPECT_THAT((*MakePacsClient(peer))->FindPatient(NewDicomUid()).status(),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("our AE title STRANGER")));
  peer.own_ae_title = "FRIEND";
  const CtSeries series = WriteCtSeries(EmptyTestFolder("client_titles_sent"), {.slices = 1});
  EXPECT_THAT((*MakePacsClient(peer))->Store(series.files), IsOk());
  peer.ae_title = "ELSEWHERE";
  EXPECT_THAT((*MakePacsClient(peer))->FindPatient(NewDicomUid()).status(),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("is not called ELSEWHERE")));
}

TEST(PacsClient, RefusedObjectIsReportedByItsUid) {
  RecordingSink sink;
  sink.Answer(absl::InternalError("not now"));
  const auto folder =
      *InstanceFolder::Open({.path = EmptyTestFolder("client_refused"), .watermark_bytes = 0});
  ReceiverOptions options;
  options.calling_ae_titles = {"TISSUEFORM"};
  const auto receiver = StorageReceiver::Start(options, folder.get(), &sink);
  ASSERT_THAT(receiver.status(), IsOk());
  const CtSeries series = WriteCtSeries(EmptyTestFolder("client_refused_sent"), {.slices = 1});
  PacsPeer peer;
  peer.name = "strict";
  peer.host = "127.0.0.1";
  peer.port = (*receiver)->port();
  peer.ae_title = "TISSUEFORM";
  const auto stored = (*MakePacsClient(peer))->Store(series.files);
  ASSERT_THAT(stored.status(), IsOk());
  ASSERT_THAT(*stored, SizeIs(1));
  EXPECT_THAT((*stored)[0].status,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(series.instance_uids[0])));
  EXPECT_THAT((*stored)[0].status,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("0x0110")));
  sink.Answer(absl::AlreadyExistsError("it is there"));
  const auto again = (*MakePacsClient(peer))->Store(series.files);
  ASSERT_THAT(again.status(), IsOk());
  EXPECT_THAT((*again)[0].status, IsOk()) << "a duplicate of our own UID is what was sent before";
}

// What a STOW-RS server that takes one spelling of the boundary says of one object.
absl::Status StoreToStrictServer(const std::string& spelling) {
  const fs::path home = EmptyTestFolder("strict_stow_" + spelling);
  const int port = FreePort();
  ChildOptions options;
  options.program = "python3";
  options.arguments = {SourcePath("tests/client/pacs_bridge/network/strict_stow.py"),
                       absl::StrCat(port), spelling};
  options.output = ChildStream::File(home / "log");
  options.errors = ChildStream::File(home / "log");
  const auto server = GuardedProgram::Start(options, std::chrono::milliseconds(200));
  EXPECT_THAT(server.status(), IsOk());
  EXPECT_TRUE(WaitForPort(port)) << BytesOfFile(home / "log");
  PacsPeer peer{.name = "strict", .kind = PacsPeer::Kind::kDicomWeb};
  peer.url = absl::StrCat("http://127.0.0.1:", port);
  const CtSeries series = WriteCtSeries(home, {.slices = 1});
  const auto stored = (*MakePacsClient(peer))->Store(series.files);
  return stored.ok() ? stored->at(0).status : stored.status();
}

TEST(PacsClient, ServersThatTakeOneSpellingOfTheBoundaryGetIt) {
  EXPECT_THAT(StoreToStrictServer("quoted"), IsOk());
  EXPECT_THAT(StoreToStrictServer("bare"), IsOk());
  EXPECT_THAT(StoreToStrictServer("neither"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("HTTP status 400")));
}

TEST(PacsClient, InvalidPeersAreReported) {
  PacsPeer peer;
  peer.name = "p";
  EXPECT_THAT(MakePacsClient(peer).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 to 16 ASCII characters")));
  peer.ae_title = "P";
  EXPECT_THAT(MakePacsClient(peer).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("a host and a port")));
  peer.kind = PacsPeer::Kind::kDicomWeb;
  for (const auto& [url, message] : std::vector<std::pair<std::string, std::string>>{
           {"", "it has no URL"},
           {"http://pacs.example/dicom-web", "must be https"},
           {"ftp://127.0.0.1/", "must be https"},
           {"https://u:p@pacs.example/", "a user or password"}}) {
    peer.url = url;
    EXPECT_THAT(MakePacsClient(peer).status(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(message)));
  }
}

}  // namespace
}  // namespace tissueform::testing
