// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/socket_call.h"

#include <utility>

#include "client/gateway/method_table.h"
#include "client/gateway/web_call.h"
#include "server/platform/network_address.h"

namespace tissueform {
namespace {

// Half of what a page waits for before it says that it waits (calls/silence.ts).
constexpr int kHeartbeatSeconds = 2;

}  // namespace

void SocketCall::OnOpen() { socket_->Receive(); }

void SocketCall::OnMessage(std::string message) {
  if (finished_ || socket_ == nullptr) return;
  const absl::StatusOr<SocketFrame> frame = ParseClientFrame(message);
  if (!frame.ok()) {
    return Fail(GatewayEvent::kMalformedFrame, frame.status(), SocketClose::kProtocolError);
  }
  OnFrame(*frame, &message);
}

void SocketCall::OnFrame(const SocketFrame& frame, std::string* message) {
  const bool is_start = frame.kind == SocketFrameKind::kStart;
  if (is_start == started_ || half_closed_) {
    return Fail(GatewayEvent::kMalformedFrame,
                absl::InvalidArgumentError("frame: a start comes first, once, and nothing after a "
                                           "half-close"),
                SocketClose::kProtocolError);
  }
  if (is_start) return Start(frame.payload);
  if (frame.kind == SocketFrameKind::kHalfClose) {
    half_closed_ = true;
    if (!writing_ && upstream_ != nullptr) upstream_->HalfClose();
    return socket_->Receive();  // to see it close
  }
  message->erase(0, kSocketFrameHeadBytes);
  Forward(std::move(*message));
}

void SocketCall::Start(absl::string_view payload) {
  absl::StatusOr<CallStart> start = ParseStart(payload);
  if (!start.ok()) {
    const GatewayEvent event = start.status().code() == absl::StatusCode::kUnimplemented
                                   ? GatewayEvent::kMethodRefused
                                   : GatewayEvent::kMetadataRefused;
    return Fail(event, start.status(), SocketClose::kProtocolError);
  }
  start->metadata[kClientAddressHeader] = client_address_;
  absl::StatusOr<CallSlot> slot = pool_->Take();
  if (!slot.ok()) return Fail(GatewayEvent::kNoCallSlot, slot.status(), SocketClose::kNormal);
  started_ = true;
  tells_begin_ = start->tells_begin;
  wants_heartbeat_ = start->wants_heartbeat;
  counters_->Add(GatewayEvent::kSocketCall);
  answer_type_ = AnswerOf(start->method);
  upstream_ = UpstreamCall::Begin(*std::move(slot), *start, socket_, shared_from_this());
  if (wants_heartbeat_) SendHeartbeat();
  socket_->Receive();
}

void SocketCall::OnBegun(std::map<std::string, std::string> headers) {
  if (finished_ || upstream_ == nullptr) return;
  if (!tells_begin_ || headers.empty()) return upstream_->Read();
  Send(BeginFrame(headers));
}

void SocketCall::OnSecond() {
  if (finished_ || socket_ == nullptr || sending_ || !wants_heartbeat_) return;
  if (++quiet_seconds_ > kHeartbeatSeconds) SendHeartbeat();
}

void SocketCall::SendHeartbeat() {
  sending_heartbeat_ = true;
  Send(HeartbeatFrame());
}

void SocketCall::Send(std::string frame) {
  quiet_seconds_ = 0;
  if (sending_) {
    behind_heartbeat_ = std::move(frame);
    return;
  }
  sending_ = true;
  socket_->Send(std::move(frame));
}

void SocketCall::Forward(std::string payload) {
  if (upstream_ == nullptr) return;
  if (writing_) {
    waiting_ = std::move(payload);  // and no more is received until it is written
    return;
  }
  writing_ = true;
  upstream_->Write(payload);
  socket_->Receive();
}

void SocketCall::OnWritten() {
  writing_ = false;
  if (finished_ || upstream_ == nullptr) return;
  if (waiting_.has_value()) {
    std::string payload = *std::move(waiting_);
    waiting_.reset();
    return Forward(std::move(payload));
  }
  if (half_closed_) upstream_->HalfClose();
}

void SocketCall::OnAnswer(const grpc::ByteBuffer& message) {
  if (finished_) return;
  absl::StatusOr<std::string> frame = MessageFrame(message, answer_type_);
  if (!frame.ok()) return Finish(EndOf(frame.status()), SocketClose::kNormal);
  Send(*std::move(frame));
}

void SocketCall::OnSent() {
  sending_ = false;
  const bool was_heartbeat = std::exchange(sending_heartbeat_, false);
  if (!behind_heartbeat_.empty()) return Send(std::exchange(behind_heartbeat_, {}));
  if (!finished_) {
    if (!was_heartbeat && upstream_ != nullptr) upstream_->Read();
    return;
  }
  if (end_frame_.empty()) return socket_->Close(close_);
  sending_ = true;
  socket_->Send(std::exchange(end_frame_, {}));
}

void SocketCall::OnEnd(CallEnd end) {
  upstream_ = nullptr;
  Finish(end, SocketClose::kNormal);
}

void SocketCall::OnBadMessage(SocketClose why) {
  if (finished_) return;
  const bool is_text = why == SocketClose::kText;
  Fail(is_text ? GatewayEvent::kTextFrame : GatewayEvent::kMessageTooLarge,
       absl::InvalidArgumentError(is_text ? "frame: text; send binary messages"
                                          : "frame: too large"),
       why);
}

void SocketCall::OnSilence() {
  Fail(GatewayEvent::kNoStart,
       absl::DeadlineExceededError("no start frame arrived; open the socket when there is a call"),
       SocketClose::kNormal);
}

void SocketCall::OnGone() {
  finished_ = true;
  if (const auto upstream = std::move(upstream_); upstream != nullptr) upstream->Cancel();
  socket_ = nullptr;
}

void SocketCall::OnDrain() {
  Finish(EndOf(absl::UnavailableError("the gateway is shutting down; connect again in a moment")),
         SocketClose::kGoingAway);
}

void SocketCall::Fail(GatewayEvent event, const absl::Status& status, SocketClose close) {
  counters_->Add(event);
  Finish(EndOf(status), close);
}

void SocketCall::Finish(const CallEnd& end, SocketClose close) {
  if (finished_ || socket_ == nullptr) return;
  finished_ = true;
  close_ = close;
  waiting_.reset();
  if (const auto upstream = std::move(upstream_); upstream != nullptr) upstream->Cancel();
  end_frame_ = EndFrame(end);
  if (!sending_) OnSent();
}

}  // namespace tissueform
