// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/watch_stream.h"

#include <chrono>

#include "client/cpp/client_call.h"

namespace tissueform {
namespace {

// Of an acknowledgement, which does nothing but count.
constexpr std::chrono::seconds kAckDeadline{10};

}  // namespace

WatchStream::~WatchStream() {
  if (call_ != nullptr && !finished_) {
    Cancel();
    Finish().IgnoreError();
  }
}

absl::Status WatchStream::Start() {
  routes_->AddHeaders(session_, &context_);
  v1::WatchRequest request;
  request.set_session(session_);
  if (options_.max_unacked.has_value()) request.set_max_unacked(*options_.max_unacked);
  call_ = stub_->Watch(&context_, request);
  v1::WatchResponse response;
  if (!call_->Read(&response)) return Finish();
  if (!response.has_started()) {
    return absl::InternalError(
        "the watch did not start with `started`; the server has another version");
  }
  name_ = response.started().watch();
  node_ = NodeOf(context_);
  routes_->Remember(session_, node_);
  form_ = std::move(*response.mutable_started()->mutable_form());
  return absl::OkStatus();
}

std::optional<v1::WatchFrame> WatchStream::Receive() {
  v1::WatchResponse response;
  while (call_->Read(&response)) {
    if (response.has_frame()) return std::move(*response.mutable_frame());
    if (response.has_form()) form_ = std::move(*response.mutable_form());
    if (response.has_notice() && options_.on_notice) options_.on_notice(response.notice());
  }
  return std::nullopt;
}

absl::Status WatchStream::Ack(const v1::WatchFrame& frame) {
  grpc::ClientContext context;
  routes_->AddHeaders(session_, &context);
  context.set_deadline(std::chrono::system_clock::now() + kAckDeadline);
  v1::AcknowledgeWatchRequest request;
  request.set_watch(name_);
  request.set_number(frame.number());
  google::protobuf::Empty response;
  return EndOfCall(stub_->AcknowledgeWatch(&context, request, &response));
}

absl::Status WatchStream::Finish() {
  v1::WatchResponse dropped;
  while (call_->Read(&dropped)) {
    if (dropped.has_notice() && options_.on_notice) options_.on_notice(dropped.notice());
  }
  finished_ = true;
  const absl::Status end = EndOfCall(call_->Finish(), was_cancelled_);
  routes_->LearnFrom(end, session_);
  return end;
}

}  // namespace tissueform
