// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/web_call.h"

#include <utility>
#include <vector>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/support/slice.h"

#include "client/gateway/call_metadata.h"
#include "client/gateway/method_table.h"
#include "client/gateway/web_frames.h"
#include "core/base/error_reason.h"
#include "server/platform/network_address.h"

namespace tissueform {
namespace {

std::string Joined(const grpc::ByteBuffer& message) {
  std::vector<grpc::Slice> slices;
  std::string text;
  if (!message.Dump(&slices).ok()) return text;
  text.reserve(message.Length());
  for (const grpc::Slice& slice : slices) {
    text.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  }
  return text;
}

absl::StatusOr<CallStart> StartOf(const HttpHead& head) {
  CallStart start = {.method = std::string(head.Path()), .metadata = MetadataOf(head)};
  if (absl::Status status = CheckMetadata(start.metadata); !status.ok()) return status;
  if (head.Count("grpc-timeout") > 0) {
    const auto timeout = ParseGrpcTimeout(head.Field("grpc-timeout"));
    if (!timeout.ok()) return timeout.status();
    start.timeout = *timeout;
  }
  return start;
}

}  // namespace

CallEnd EndOf(const absl::Status& status) {
  const ErrorInfo info = ErrorInfoOf(status);
  google::rpc::ErrorInfo proto;
  proto.set_reason(info.reason);
  proto.set_domain("tissueform");
  proto.mutable_metadata()->insert(info.metadata.begin(), info.metadata.end());
  google::rpc::Status details;
  details.set_code(static_cast<int>(status.code()));
  details.set_message(std::string(status.message()));
  details.add_details()->PackFrom(proto);
  return {.status = grpc::Status(static_cast<grpc::StatusCode>(status.code()),
                                 std::string(status.message()), details.SerializeAsString())};
}

void WebCall::Begin(const HttpHead& head, absl::string_view body, UpstreamPool* pool,
                    GatewayCounters* counters) {
  const absl::Status status = TryBegin(head, body, pool, counters);
  if (!status.ok()) OnEnd(EndOf(status));
}

absl::Status WebCall::TryBegin(const HttpHead& head, absl::string_view body, UpstreamPool* pool,
                               GatewayCounters* counters) {
  const auto counted = [counters](GatewayEvent event, const absl::Status& status) {
    counters->Add(event);
    return status;
  };
  if (KindOf(head.Path()) == MethodKind::kLong) {
    return counted(
        GatewayEvent::kMethodRefused,
        absl::UnimplementedError("this method needs a WebSocket: GET /call, see docs/gateway.md"));
  }
  auto start = StartOf(head);
  if (!start.ok()) return counted(GatewayEvent::kMetadataRefused, start.status());
  start->metadata[kClientAddressHeader] = client_address_;
  const auto message = ParseWebRequest(body);
  if (!message.ok()) return counted(GatewayEvent::kMalformedFrame, message.status());
  auto slot = pool->Take();
  if (!slot.ok()) return counted(GatewayEvent::kNoCallSlot, slot.status());
  counters->Add(GatewayEvent::kWebCall);
  upstream_ = UpstreamCall::Begin(*std::move(slot), *start, reply_, shared_from_this());
  upstream_->Write(std::string(*message));
  return absl::OkStatus();
}

void WebCall::OnBegun(std::map<std::string, std::string> headers) {
  headers_ = std::move(headers);
  if (upstream_ != nullptr) upstream_->Read();
}

void WebCall::OnWritten() {
  if (upstream_ != nullptr) upstream_->HalfClose();
}

void WebCall::OnAnswer(const grpc::ByteBuffer& message) {
  if (reply_ == nullptr || end_.has_value()) return;
  if (!begun_) BeginReply({headers_.begin(), headers_.end()});
  sending_ = true;
  reply_->Send(WebMessageFrame(Joined(message)), false);
}

void WebCall::OnSent() {
  sending_ = false;
  if (end_.has_value()) return SendEnd(*end_);
  if (upstream_ != nullptr) upstream_->Read();
}

void WebCall::OnEnd(CallEnd end) {
  upstream_ = nullptr;
  if (reply_ == nullptr) return;
  if (!sending_) return SendEnd(end);
  end_ = std::move(end);
}

void WebCall::SendEnd(CallEnd end) {
  const bool has_messages = begun_;
  if (!has_messages) {
    end.trailers.insert(headers_.begin(), headers_.end());  // one field of each name
    BeginReply(WebEndFields(end));
  }
  reply_->Send(has_messages ? WebEndFrame(end) : std::string(), true);
  Done();
}

void WebCall::BeginReply(const HttpFields& fields) {
  begun_ = true;
  HttpReply head = {.status = 200, .fields = fields_};
  head.fields.emplace_back("content-type", std::string(kWebContentType));
  head.fields.emplace_back("cache-control", "no-store");
  for (const auto& field : fields) head.fields.push_back(field);
  reply_->Begin(head);
}

void WebCall::OnGone() { Done(); }

void WebCall::OnDrain() {
  if (end_.has_value() || reply_ == nullptr) return;
  if (const auto upstream = std::move(upstream_); upstream != nullptr) upstream->Cancel();
  OnEnd(EndOf(absl::UnavailableError("the gateway is shutting down; try again in a moment")));
}

void WebCall::Done() {
  if (const auto upstream = std::move(upstream_); upstream != nullptr) upstream->Cancel();
  reply_ = nullptr;
}

}  // namespace tissueform
