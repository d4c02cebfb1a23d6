// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/client_address.h"

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"

#include "server/platform/network_address.h"
#include "server/rpc/calls/call_scope.h"
#include "tests/testing/test_authority.h"
#include "tissueform/v1/server_info.grpc.pb.h"

namespace tissueform::testing {
namespace {

// Records the address from which each call comes.
class AddressNote final : public CallObserver {
 public:
  absl::Status OnBegin(const ObservedCall& call) override {
    address = std::string(call.address);
    return absl::OkStatus();
  }
  void OnResource(const ObservedCall& /*call*/) override {}
  void OnEnd(const ObservedCall& /*call*/, const absl::Status& /*outcome*/,
             std::chrono::steady_clock::duration /*elapsed*/) override {}

  std::string address;
};

// Behind TLS, with client certificates that may be shown.
class ClientAddressTest : public ::testing::Test, public v1::ServerInfoService::CallbackService {
 protected:
  ClientAddressTest() {
    const TestIdentity own = authority_.Issue();
    grpc::SslServerCredentialsOptions tls(GRPC_SSL_REQUEST_CLIENT_CERTIFICATE_AND_VERIFY);
    tls.pem_root_certs = authority_.certificate();
    tls.pem_key_cert_pairs.push_back({own.key, own.certificate});
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::SslServerCredentials(tls), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }

  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* context,
                                          const v1::GetServerInfoRequest* /*request*/,
                                          v1::ServerInfo* /*response*/) override {
    return HandleUnaryCall(context, "Test.Call", &gate_,
                           [](const CallScope&, const FinishCall& end) {
                             end(absl::OkStatus());
                             return absl::OkStatus();
                           });
  }

  // The address that is noted of a call with this certificate and these headers.
  std::string AddressFor(const TestIdentity& identity, const std::vector<std::string>& stated) {
    grpc::SslCredentialsOptions tls;
    tls.pem_root_certs = authority_.certificate();
    tls.pem_cert_chain = identity.certificate;
    tls.pem_private_key = identity.key;
    const auto stub = v1::ServerInfoService::NewStub(
        grpc::CreateChannel(absl::StrCat("localhost:", port_), grpc::SslCredentials(tls)));
    grpc::ClientContext context;
    for (const std::string& value : stated) context.AddMetadata(kClientAddressHeader, value);
    v1::ServerInfo info;
    const grpc::Status status = stub->GetServerInfo(&context, {}, &info);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return note_.address;
  }

  const TestAuthority authority_;
  const TestIdentity gateway_ =
      authority_.Issue({.name = "gateway", .alternatives = "DNS:gateway.example.org"});
  const TestIdentity workstation_ =
      authority_.Issue({.name = "gateway.example.org", .alternatives = "DNS:workstation"});
  AddressNote note_;
  AdmissionControl gate_{{.observer = &note_, .gateway_name = "gateway.example.org"}};
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

TEST_F(ClientAddressTest, AcceptsTheClientAddressFromTheGateway) {
  EXPECT_EQ(AddressFor(gateway_, {"198.51.100.7"}), "198.51.100.7");
  EXPECT_EQ(AddressFor(gateway_, {"2001:DB8::7"}), "2001:db8::7");
}

TEST_F(ClientAddressTest, IgnoresTheClientAddressFromOthers) {
  EXPECT_EQ(AddressFor(workstation_, {"198.51.100.7"}), "127.0.0.1");
  EXPECT_EQ(AddressFor({}, {"198.51.100.7"}), "127.0.0.1");
}

TEST_F(ClientAddressTest, IgnoresInvalidOrRepeatedAddresses) {
  EXPECT_EQ(AddressFor(gateway_, {"John Doe"}), "127.0.0.1");
  EXPECT_EQ(AddressFor(gateway_, {"198.51.100.7", "198.51.100.8"}), "127.0.0.1");
  EXPECT_EQ(AddressFor(gateway_, {}), "127.0.0.1");
}

TEST_F(ClientAddressTest, CallWithoutANetworkHasNoAddress) {
  EXPECT_EQ(ClientAddress(nullptr, {.certificate_names = {"gateway"}}, "gateway"), "");
}

}  // namespace
}  // namespace tissueform::testing
