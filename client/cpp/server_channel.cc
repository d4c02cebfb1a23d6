// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/server_channel.h"

#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "grpcpp/support/client_interceptor.h"

#include "core/base/certificates.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// In place of gRPC's call credentials, which go over TLS only: loopback connections have no TLS.
class TokenSender final : public grpc::experimental::Interceptor {
 public:
  explicit TokenSender(std::shared_ptr<TokenFile> token) : token_(std::move(token)) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace("authorization",
                                                 absl::StrCat("Bearer ", token_->Current()));
    }
    methods->Proceed();
  }

 private:
  const std::shared_ptr<TokenFile> token_;
};

class TokenSenders final : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenSenders(std::shared_ptr<TokenFile> token) : token_(std::move(token)) {}

  grpc::experimental::Interceptor* CreateClientInterceptor(
      grpc::experimental::ClientRpcInfo*) override {
    return new TokenSender(token_);
  }

 private:
  const std::shared_ptr<TokenFile> token_;
};

bool IsLoopbackIpv4(absl::string_view host) {
  const std::vector<absl::string_view> parts = absl::StrSplit(host, '.');
  if (parts.size() != 4 || parts[0] != "127") return false;
  for (const absl::string_view part : parts) {
    int number = 0;
    if (part.size() > 3 || !absl::SimpleAtoi(part, &number) || number < 0 || number > 255) {
      return false;
    }
  }
  return true;
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> CredentialsOf(
    const ConnectionOptions& options) {
  if (!options.encrypted()) return grpc::InsecureChannelCredentials();
  const TlsFiles files = {.certificate = options.tls_certificate,
                          .key = options.tls_key,
                          .authorities = options.tls_ca};
  TF_ASSIGN_OR_RETURN(const TlsContents contents, ReadTlsFiles(files));
  TF_RETURN_IF_ERROR(CheckTlsContents(files, contents).status());
  return grpc::SslCredentials({.pem_root_certs = contents.authorities,
                               .pem_private_key = contents.key,
                               .pem_cert_chain = contents.certificate});
}

}  // namespace

bool IsLocalAddress(absl::string_view address) {
  if (absl::StartsWith(address, "unix:")) return true;
  const absl::string_view host = address.substr(0, address.rfind(':'));
  return host == "localhost" || host == "[::1]" || IsLoopbackIpv4(host);
}

absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeServerChannel(
    const std::string& address, const ConnectionOptions& options,
    const std::shared_ptr<TokenFile>& token, const grpc::ChannelArguments& arguments) {
  if (absl::StartsWith(address, "http://") || absl::StartsWith(address, "https://")) {
    return absl::InvalidArgumentError(
        absl::StrCat(address, " is a URL; give HOST:PORT or unix:/PATH"));
  }
  if (!options.encrypted() && !IsLocalAddress(address)) {
    if (token != nullptr) {
      return absl::FailedPreconditionError(
          absl::StrCat("the token would go to ", address,
                       " unencrypted; give --tls or --tls-ca FILE, or no token"));
    }
    if (!options.insecure) {
      return absl::FailedPreconditionError(
          absl::StrCat(address,
                       " is another machine; give --tls or --tls-ca FILE, or --insecure "
                       "if its network is isolated"));
    }
  }
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<grpc::ChannelCredentials> credentials,
                      CredentialsOf(options));
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> senders;
  if (token != nullptr) senders.push_back(std::make_unique<TokenSenders>(token));
  return grpc::experimental::CreateCustomChannelWithInterceptors(address, credentials, arguments,
                                                                 std::move(senders));
}

absl::StatusOr<std::shared_ptr<TokenFile>> OpenTokenOf(const ConnectionOptions& options) {
  if (options.token_file.empty()) return nullptr;
  return TokenFile::Open(options.token_file);
}

}  // namespace tissueform
