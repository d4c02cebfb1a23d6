// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/client/gateway/fake_server.h"

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "grpcpp/health_check_service_interface.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server_builder.h"
#include "grpcpp/support/slice.h"

namespace tissueform::testing {
namespace {

grpc::ByteBuffer BufferOf(const std::string& text) {
  const grpc::Slice slice(text);
  return grpc::ByteBuffer(&slice, 1);
}

class FakeCall final : public grpc::ServerGenericBidiReactor {
 public:
  FakeCall(FakeServer* server, grpc::GenericCallbackServerContext* context) : server_(server) {
    ++server_->open;
    const std::string& method = context->method();
    if (absl::EndsWith(method, "/Deform") || absl::EndsWith(method, "/GetMesh")) {
      context->AddInitialMetadata("x-tissueform-node", server->name());
      context->AddInitialMetadata("secret", "no");
      context->AddTrailingMetadata("x-tissueform-node", server->name());
      context->AddTrailingMetadata("secret", "no");
      StartRead(&message_);
    } else if (absl::EndsWith(method, "/ReadCase") || absl::EndsWith(method, "/Watch")) {
      endless_ = true;
      message_ = BufferOf(std::string(FakeServer::kEndlessBytes, 'e'));
      StartWrite(&message_);
    } else if (absl::EndsWith(method, "/GetSession")) {
      std::string seen;
      for (const auto& [name, value] : context->client_metadata()) {
        absl::StrAppend(&seen, absl::string_view(name.data(), name.size()), "=",
                        absl::string_view(value.data(), value.size()), "\n");
      }
      message_ = BufferOf(seen);
      StartWriteAndFinish(&message_, grpc::WriteOptions(), grpc::Status::OK);
      finished_ = true;
    } else if (!absl::EndsWith(method, "/ListMeshes") && !absl::EndsWith(method, "/Stuck")) {
      context->AddInitialMetadata("x-tissueform-node", server->name());
      context->AddTrailingMetadata("x-tissueform-node", server->name());
      End(server->end());
    }
  }

 private:
  void End(const grpc::Status& status) {
    if (!finished_.exchange(true)) Finish(status);
  }

  void OnReadDone(bool ok) override {
    if (!ok) return End(grpc::Status::OK);
    StartWrite(&message_);
  }
  void OnWriteDone(bool ok) override {
    if (finished_ || !ok) return;
    if (!endless_) return StartRead(&message_);
    ++server_->written;
    StartWrite(&message_);
  }
  void OnCancel() override {
    ++server_->cancelled;
    End(grpc::Status::CANCELLED);
  }
  void OnDone() override {
    --server_->open;
    delete this;
  }

  FakeServer* const server_;
  bool endless_ = false;
  std::atomic<bool> finished_ = false;
  grpc::ByteBuffer message_;
};

}  // namespace

FakeServer::FakeServer(std::string name) : name_(std::move(name)) {
  grpc::EnableDefaultHealthCheckService(true);
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
  builder.RegisterCallbackGenericService(this);
  server_ = builder.BuildAndStart();
}

FakeServer::~FakeServer() {
  server_->Shutdown(std::chrono::system_clock::now());
  server_->Wait();
}

std::string FakeServer::address() const { return absl::StrCat("127.0.0.1:", port_); }

void FakeServer::SetServing(bool serving) {
  server_->GetHealthCheckService()->SetServingStatus(serving);
}

void FakeServer::EndWith(const grpc::Status& end) {
  MutexLock lock(mutex_);
  end_ = end;
}

grpc::Status FakeServer::end() const {
  MutexLock lock(mutex_);
  return end_;
}

grpc::ServerGenericBidiReactor* FakeServer::CreateReactor(
    grpc::GenericCallbackServerContext* context) {
  return new FakeCall(this, context);
}

}  // namespace tissueform::testing
