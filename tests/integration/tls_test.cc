// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "gtest/gtest.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

// The server behind TLS: its certificates rotate, and clients without the right ones are refused.
namespace tissueform::testing {
namespace {

using std::chrono::hours;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr absl::StatusCode kUnavailable = absl::StatusCode::kUnavailable;
constexpr std::chrono::milliseconds kSoon{500};

class TlsTest : public ServiceTest {
 protected:
  ~TlsTest() override { std::filesystem::remove_all(folder_); }

  // With these files, which are rotated by rewriting them.
  void Serve(bool with_clients, bool required = true) {
    ServerOptions options = TestOptions();
    options.tls.certificate = own_.certificate;
    options.tls.key = own_.key;
    if (with_clients) options.tls.client_ca = own_.roots;
    options.tls.client_certificate_required = required;
    StartServer(options);
  }

  std::string name() { return absl::StrCat("localhost:", server().port()); }

  absl::StatusOr<std::unique_ptr<TissueformClient>> ConnectWith(
      const ConnectionOptions& connection, std::chrono::milliseconds deadline = kSoon) {
    return TissueformClient::Connect(name(), {.connect_deadline = deadline,
                                              .call_deadline = std::chrono::seconds(30),
                                              .own_connection = true,
                                              .connection = connection});
  }

  ConnectionOptions Shown(const TestFiles& files) const {
    return {.tls_ca = own_.roots, .tls_certificate = files.certificate, .tls_key = files.key};
  }

  const std::filesystem::path folder_ = EmptyTestFolder("tls");
  const TestAuthority authority_;
  const TestAuthority stranger_{"A stranger"};
  const TestFiles own_ = authority_.IssueFiles(folder_, "server");
};

TEST_F(TlsTest, ADragRunsEncrypted) {
  Serve(false);
  ASSERT_OK_AND_ASSIGN(const auto client, ConnectWith({.tls_ca = own_.roots}));
  const v1::Session session = MakeSession(client.get(), BarProblem(1));
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
  EXPECT_THAT(stream->SendPoses(1, TopPose(SomePose(1))), IsOk());
  EXPECT_TRUE(stream->Receive().has_value());
}

TEST_F(TlsTest, ClientsJudgeTheServersCertificate) {
  Serve(false);
  WriteTestFile(folder_ / "stranger.pem", stranger_.certificate());
  EXPECT_THAT(ConnectWith({.tls_ca = folder_ / "stranger.pem"}), StatusIs(kUnavailable));
  EXPECT_THAT(ConnectWith({.tls = true}), StatusIs(kUnavailable));
  EXPECT_THAT(ConnectWith({}), StatusIs(kUnavailable));
  EXPECT_THAT(ConnectWith({.tls_ca = own_.roots}), IsOk());
}

TEST_F(TlsTest, OnlyACertificateOfTheAuthorityGetsInWhereOneIsRequired) {
  Serve(true);
  const TestFiles good = authority_.IssueFiles(folder_, "good");
  const TestFiles strange = stranger_.IssueFiles(folder_, "strange");
  EXPECT_THAT(ConnectWith(Shown(good)), IsOk());
  EXPECT_THAT(ConnectWith({.tls_ca = own_.roots}), StatusIs(kUnavailable));
  EXPECT_THAT(ConnectWith(Shown(strange)), StatusIs(kUnavailable));
}

TEST_F(TlsTest, RefusesABadClientCertificateEvenIfOptional) {
  Serve(true, false);
  const TestFiles strange = stranger_.IssueFiles(folder_, "strange");
  EXPECT_THAT(ConnectWith({.tls_ca = own_.roots}), IsOk());
  EXPECT_THAT(ConnectWith(Shown(strange)), StatusIs(kUnavailable));
}

TEST_F(TlsTest, AnExpiredCertificateOfAClientIsRefused) {
  Serve(true);
  // Our client would not show one.
  const TestIdentity old = authority_.Issue({.begins = hours(-48), .ends = hours(-24)});
  grpc::SslCredentialsOptions tls;
  tls.pem_root_certs = authority_.certificate();
  tls.pem_cert_chain = old.certificate;
  tls.pem_private_key = old.key;
  const auto stub =
      v1::ServerInfoService::NewStub(grpc::CreateChannel(name(), grpc::SslCredentials(tls)));
  grpc::ClientContext context;
  v1::ServerInfo info;
  EXPECT_EQ(stub->GetServerInfo(&context, {}, &info).error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(TlsTest, RotationUnderLoadFailsNoCall) {
  Serve(false);
  // Clients trust the authority before and the one after.
  const std::string both = folder_ / "both.pem";
  WriteTestFile(both, authority_.certificate() + stranger_.certificate());
  WriteTestFile(folder_ / "stranger.pem", stranger_.certificate());
  std::atomic<bool> ends = false;
  std::atomic<int> calls = 0;
  std::atomic<int> failures = 0;
  const auto count = [&](const absl::Status& status) {
    ++calls;
    if (!status.ok()) ++failures;
    EXPECT_THAT(status, IsOk());
  };
  constexpr int kThreads = 2;
  std::vector<std::thread> load;
  load.reserve(kThreads);
  for (int i = 0; i < kThreads; ++i) {
    load.emplace_back([&] {
      while (!ends) {  // a handshake each
        const auto client = ConnectWith({.tls_ca = both}, std::chrono::seconds(30));
        count(client.status());
        if (client.ok()) count((*client)->GetServerInfo().status());
      }
    });
  }
  load.emplace_back([&] {
    const auto client = ConnectWith({.tls_ca = both}, std::chrono::seconds(30));
    ASSERT_THAT(client, IsOk());
    const v1::Session session = MakeSession(client->get(), BarProblem(2));
    while (!ends) count((*client)->DeformOnce(session.name(), TopPose(SomePose(1))).status());
  });
  for (int rotation = 1; rotation <= 3; ++rotation) {
    const TestAuthority& next = rotation % 2 == 0 ? authority_ : stranger_;
    next.IssueFiles(folder_, "server");
    EXPECT_TRUE(Eventually([&] { return server().tls_files()->rotations() == rotation; }));
    // New connections get the new certificate.
    const std::string only = folder_ / "only.pem";
    WriteTestFile(only, next.certificate());
    EXPECT_TRUE(Eventually([&] { return ConnectWith({.tls_ca = only}).ok(); })) << rotation;
  }
  ends = true;
  for (std::thread& thread : load) thread.join();
  EXPECT_EQ(failures, 0) << "of " << calls << " calls";
  RecordProperty("calls", calls);
  std::printf("%d calls, %d failed\n", calls.load(), failures.load());
}

TEST_F(TlsTest, InvalidFilesLeaveThePreviousCertificateInUse) {
  Serve(false);
  // Issuing rewrites server-ca.pem as well.
  const ConnectionOptions connection = {.tls_ca = folder_ / "ca.pem"};
  WriteTestFile(folder_ / "ca.pem", authority_.certificate());
  WriteTestFile(own_.certificate, "nonsense");
  EXPECT_TRUE(Eventually([&] { return server().tls_files()->alarm(); }));
  EXPECT_THAT(ConnectWith(connection), IsOk());
  EXPECT_EQ(server().tls_files()->rotations(), 0);
}

TEST_F(TlsTest, UnusableOptionsFailTheStartWithOneLine) {
  const TestFiles old =
      authority_.IssueFiles(folder_, "old", {.begins = hours(-48), .ends = hours(-24)});
  ServerOptions options = TestOptions();
  options.tls.certificate = old.certificate;
  options.tls.key = old.key;
  EXPECT_THAT(TissueformServer::Start(options),
              StatusIs(kInvalid, AllOf(HasSubstr(old.certificate), HasSubstr("expired"))));
  options.tls.certificate = own_.certificate;
  EXPECT_THAT(TissueformServer::Start(options), StatusIs(kInvalid, HasSubstr("does not belong")));
  options.tls = {};
  options.host = "0.0.0.0";
  EXPECT_THAT(TissueformServer::Start(options),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("--insecure")));
}

// Connected to the server; negative on errors.
int RawConnection(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
  if (connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0) return fd;
  close(fd);
  return -1;
}

TEST_F(TlsTest, UnfinishedHandshakesDoNotBlockOthers) {
  Serve(false);
  // Plain text, nothing at all, and the beginning of a handshake.
  const std::vector<std::string> openings = {"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", "",
                                             std::string("\x16\x03\x01\x02\x00\x01", 6)};
  std::vector<int> fds;
  for (int i = 0; i < 300; ++i) {
    const int fd = RawConnection(server().port());
    ASSERT_GE(fd, 0);
    const std::string& opening = openings[static_cast<size_t>(i) % openings.size()];
    EXPECT_EQ(write(fd, opening.data(), opening.size()), static_cast<ssize_t>(opening.size()));
    fds.push_back(fd);
  }
  EXPECT_THAT(ConnectWith({.tls_ca = own_.roots}, std::chrono::seconds(30)), IsOk());
  for (const int fd : fds) close(fd);
}

}  // namespace
}  // namespace tissueform::testing
