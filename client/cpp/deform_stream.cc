// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/deform_stream.h"

#include <utility>

#include "client/cpp/client_call.h"
#include "core/base/status_macros.h"

namespace tissueform {

DeformStream::~DeformStream() {
  if (call_ != nullptr && !finished_) {
    Cancel();
    Finish().IgnoreError();
  }
}

v1::DeformConfiguration DeformStream::ConfigurationOf(const Options& options) {
  v1::DeformConfiguration configuration;
  *configuration.mutable_vertices() = ToProto(options.vertices);
  configuration.set_model(options.model);
  configuration.set_encoding(options.encoding);
  if (options.prepared.has_value()) *configuration.mutable_prepared() = *options.prepared;
  if (options.max_unacked.has_value()) configuration.set_max_unacked(*options.max_unacked);
  return configuration;
}

absl::Status DeformStream::Start(v1::DeformService::Stub* stub, const Options& options,
                                 const std::shared_ptr<TokenFile>& token) {
  on_notice_ = options.on_notice;
  routes_->AddHeaders(session_, &context_);
  // Before the call is made: it may be made with a newer one, which is then sent twice.
  std::string used = token == nullptr ? "" : token->Current();
  call_ = stub->Deform(&context_);
  v1::DeformRequest request;
  *request.mutable_configuration() = ConfigurationOf(options);
  request.mutable_configuration()->set_session(session_);
  v1::DeformResponse response;
  if (!Send(request).ok() || !call_->Read(&response)) {
    return Finish();
  }
  if (!response.has_started()) {
    return absl::InternalError(
        "the stream did not start with `started`; the server has another version");
  }
  started_ = std::move(*response.mutable_started());
  node_ = NodeOf(context_);
  routes_->Remember(session_, node_);
  if (token != nullptr) {
    renewal_ = std::make_unique<TokenRenewal>(token, std::move(used), [this](const auto& renewed) {
      v1::DeformRequest renewal;
      renewal.set_token(renewed);
      Send(renewal).IgnoreError();  // how a stream ends is seen where frames are received
    });
  }
  return absl::OkStatus();
}

absl::Status DeformStream::SendPoses(uint64_t sequence, absl::Span<const NamedPose> poses,
                                     bool commit) {
  v1::DeformRequest request;
  request.mutable_pose()->set_sequence(sequence);
  request.mutable_pose()->set_commit(commit);
  for (const NamedPose& pose : poses) {
    *request.mutable_pose()->add_poses() = ToProto(pose);
  }
  return Send(request);
}

absl::Status DeformStream::Ack(const v1::DeformFrame& frame) {
  v1::DeformRequest request;
  request.mutable_ack()->set_sequence(frame.sequence());
  request.mutable_ack()->set_refinement(frame.refinement());
  return Send(request);
}

absl::Status DeformStream::Ack(uint64_t sequence) {
  v1::DeformRequest request;
  request.mutable_ack()->set_sequence(sequence);
  return Send(request);
}

void DeformStream::CloseSending() {
  MutexLock lock(send_mutex_);
  if (!std::exchange(sending_closed_, true)) {
    call_->WritesDone();
  }
}

std::optional<v1::DeformFrame> DeformStream::Receive() {
  v1::DeformResponse response;
  while (call_->Read(&response)) {
    if (response.has_frame()) {
      return std::move(*response.mutable_frame());
    }
    if (response.has_notice()) HandleNotice(response.notice());
  }
  return std::nullopt;
}

void DeformStream::HandleNotice(const v1::DeformNotice& notice) {
  if (notice.has_draining()) server_is_draining_ = true;
  if (on_notice_) on_notice_(notice);
}

void DeformStream::Cancel() {
  was_cancelled_ = true;
  context_.TryCancel();
}

absl::Status DeformStream::Finish() {
  // gRPC reports the status of a call only after everything before it was read.
  v1::DeformResponse dropped;
  while (call_->Read(&dropped)) {
    if (dropped.has_notice()) HandleNotice(dropped.notice());
  }
  renewal_.reset();
  finished_ = true;
  const absl::Status end = EndOfCall(call_->Finish(), was_cancelled_);
  routes_->LearnFrom(end, session_);
  return end;
}

absl::Status DeformStream::Send(const v1::DeformRequest& request) {
  MutexLock lock(send_mutex_);
  if (sending_closed_ || !call_->Write(request)) {
    return absl::UnavailableError("the stream has ended");
  }
  return absl::OkStatus();
}

}  // namespace tissueform
