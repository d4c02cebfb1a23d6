// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/upstream_call.h"

#include <utility>

#include "google/rpc/status.pb.h"
#include "grpcpp/support/slice.h"

#include "client/gateway/call_metadata.h"

namespace tissueform {
namespace {

constexpr int kLastCode = static_cast<int>(grpc::StatusCode::UNAUTHENTICATED);

// Where a proxy stands before the servers it may end a call in words of its own, and leave the
// server's details: these count. CANCELLED is the gateway's word alone, and it has not said it.
grpc::Status AsTheServerSaid(const grpc::Status& status) {
  google::rpc::Status details;
  grpc::StatusCode code = status.error_code();
  std::string message = status.error_message();
  const bool is_read = !status.ok() && details.ParseFromString(status.error_details());
  if (is_read && details.code() > 0 && details.code() <= kLastCode && details.code() != code) {
    code = static_cast<grpc::StatusCode>(details.code());
    message = details.message();
  }
  if (code == grpc::StatusCode::CANCELLED) code = grpc::StatusCode::UNAVAILABLE;
  return {code, message, status.error_details()};
}

}  // namespace

std::shared_ptr<UpstreamCall> UpstreamCall::Begin(CallSlot slot, const CallStart& start,
                                                  std::shared_ptr<ConnectionStrand> strand,
                                                  std::shared_ptr<UpstreamUser> user) {
  std::shared_ptr<UpstreamCall> call(
      new UpstreamCall(std::move(slot), std::move(strand), std::move(user)));
  call->self_ = call;
  for (const auto& [name, value] : start.metadata) call->context_.AddMetadata(name, value);
  if (start.timeout.has_value()) {
    call->context_.set_deadline(
        std::chrono::system_clock::now() +
        std::chrono::duration_cast<std::chrono::system_clock::duration>(*start.timeout));
  }
  call->slot_.stub().PrepareBidiStreamingCall(&call->context_, start.method, {}, call.get());
  // Reads and writes are begun outside of gRPC's callbacks: without it OnDone might come before.
  call->AddHold();
  call->begun_ = true;
  call->StartCall();
  return call;
}

UpstreamCall::UpstreamCall(CallSlot slot, std::shared_ptr<ConnectionStrand> strand,
                           std::shared_ptr<UpstreamUser> user)
    : slot_(std::move(slot)), strand_(std::move(strand)), user_(std::move(user)) {}

void UpstreamCall::Read() {
  if (!released_) StartRead(&read_);
}

void UpstreamCall::Write(const std::string& message) {
  if (released_) return;
  const grpc::Slice slice(message);
  written_ = grpc::ByteBuffer(&slice, 1);
  StartWrite(&written_);
}

void UpstreamCall::HalfClose() {
  if (!released_) StartWritesDone();
}

void UpstreamCall::Cancel() {
  user_.reset();
  if (released_) return;
  context_.TryCancel();
  Release();
}

void UpstreamCall::Release() {
  if (released_) return;
  released_ = true;
  RemoveHold();
}

void UpstreamCall::OnReadInitialMetadataDone(bool ok) {
  if (!begun_) return;
  std::map<std::string, std::string> headers;
  if (ok) headers = AllowedMetadata(context_.GetServerInitialMetadata());
  strand_->Post([self = shared_from_this(), headers = std::move(headers)]() mutable {
    if (const auto user = self->user_; user != nullptr) user->OnBegun(std::move(headers));
  });
}

void UpstreamCall::OnReadDone(bool ok) {
  if (!begun_) return;
  strand_->Post([self = shared_from_this(), ok] {
    if (!ok) return self->Release();
    if (const auto user = self->user_; user != nullptr) user->OnAnswer(self->read_);
  });
}

void UpstreamCall::OnWriteDone(bool /*ok*/) {
  if (!begun_) return;
  strand_->Post([self = shared_from_this()] {
    if (const auto user = self->user_; user != nullptr) user->OnWritten();
  });
}

void UpstreamCall::OnDone(const grpc::Status& status) {
  if (!begun_) return;
  CallEnd end = {.status = AsTheServerSaid(status),
                 .trailers = AllowedMetadata(context_.GetServerTrailingMetadata())};
  // `this` may be gone before Post returns.
  const std::shared_ptr<ConnectionStrand> strand = strand_;
  strand->Post([self = std::move(self_), end = std::move(end)]() mutable {
    if (const auto user = std::move(self->user_); user != nullptr) user->OnEnd(std::move(end));
  });
}

}  // namespace tissueform
