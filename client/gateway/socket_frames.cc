// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/socket_frames.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "grpcpp/support/slice.h"

#include "client/gateway/call_metadata.h"
#include "client/gateway/method_table.h"
#include "core/base/status_macros.h"
#include "tissueform/v1/gateway.pb.h"

namespace tissueform {
namespace {

constexpr uint8_t kVersion = 1;
constexpr uint32_t kAlignment = 4;

// Little-endian.
uint32_t GetNumber(absl::string_view frame, size_t at, size_t bytes) {
  uint32_t number = 0;
  for (size_t i = bytes; i-- > 0;) number = number << 8 | static_cast<uint8_t>(frame[at + i]);
  return number;
}

void PutNumber(uint32_t number, size_t at, size_t bytes, std::string* frame) {
  for (size_t i = 0; i < bytes; ++i) (*frame)[at + i] = static_cast<char>(number >> 8 * i);
}

void PutHead(SocketFrameKind kind, size_t payload_at, size_t payload_bytes, std::string* frame) {
  (*frame)[0] = kVersion;
  (*frame)[1] = static_cast<char>(kind);
  PutNumber(static_cast<uint32_t>(payload_at), 2, 2, frame);
  PutNumber(static_cast<uint32_t>(payload_bytes), 4, 4, frame);
}

std::string FrameOf(SocketFrameKind kind, const google::protobuf::MessageLite& message) {
  std::string frame(kSocketFrameHeadBytes, '\0');
  message.AppendToString(&frame);
  PutHead(kind, kSocketFrameHeadBytes, frame.size() - kSocketFrameHeadBytes, &frame);
  return frame;
}

absl::Status NoFrame(absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat("frame: ", why, "; see docs/gateway.md"));
}

}  // namespace

absl::StatusOr<SocketFrame> ParseClientFrame(absl::string_view frame) {
  if (frame.size() < kSocketFrameHeadBytes) return NoFrame("shorter than its head");
  if (static_cast<uint8_t>(frame[0]) != kVersion) return NoFrame("its version is not 1");
  const auto kind = static_cast<uint8_t>(frame[1]);
  if (kind < 1 || kind > 3) return NoFrame("its kind is not start, message or half-close");
  if (GetNumber(frame, 2, 2) != kSocketFrameHeadBytes) {
    return NoFrame("its payload does not begin at 32");
  }
  if (GetNumber(frame, 4, 4) != frame.size() - kSocketFrameHeadBytes) {
    return NoFrame("its payload has another length than stated");
  }
  const absl::string_view unused = frame.substr(8, kSocketFrameHeadBytes - 8);
  if (std::any_of(unused.begin(), unused.end(), [](char c) { return c != 0; })) {
    return NoFrame("bytes 8 to 31 are not 0");
  }
  const SocketFrame parsed = {.kind = static_cast<SocketFrameKind>(kind),
                              .payload = frame.substr(kSocketFrameHeadBytes)};
  if (parsed.kind == SocketFrameKind::kHalfClose && !parsed.payload.empty()) {
    return NoFrame("a half-close has a payload");
  }
  return parsed;
}

absl::StatusOr<CallStart> ParseStart(absl::string_view payload) {
  v1::GatewayCallStart message;
  if (!message.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) {
    return NoFrame("its payload is not a GatewayCallStart");
  }
  if (!IsServedMethod(message.method())) {
    return absl::UnimplementedError("start: only methods of tissueform.v1 are served");
  }
  CallStart start = {.method = message.method()};
  for (const auto& [name, value] : message.metadata()) {
    if (!MayBeSent(name)) {
      return absl::InvalidArgumentError(
          "start: allowed metadata are authorization, x-tissueform-session, x-tissueform-node and "
          "traceparent");
    }
    start.metadata.emplace(name, value);
  }
  TF_RETURN_IF_ERROR(CheckMetadata(start.metadata));
  start.tells_begin = message.tells_begin();
  start.wants_heartbeat = message.wants_heartbeat();
  if (message.deadline_ms() < 0) {
    return absl::InvalidArgumentError("start: deadline_ms is below 0");
  }
  if (message.deadline_ms() > 0) {
    constexpr int64_t kLongestMilliseconds = int64_t{366} * 24 * 3600 * 1000;
    start.timeout =
        std::chrono::milliseconds(std::min(message.deadline_ms(), kLongestMilliseconds));
  }
  return start;
}

absl::StatusOr<std::string> MessageFrame(const grpc::ByteBuffer& message,
                                         const google::protobuf::Descriptor* type) {
  std::vector<grpc::Slice> slices;
  if (!message.Dump(&slices).ok()) return absl::InternalError("an answer is invalid");
  const size_t size = message.Length();
  std::string payload;
  payload.reserve(size);
  for (const grpc::Slice& slice : slices) {
    payload.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  }
  const BytesPlace place = type != nullptr ? LongestBytes(payload, *type) : BytesPlace{};
  const size_t shift = place.size > 0 ? (kAlignment - place.offset % kAlignment) % kAlignment : 0;
  std::string frame(kSocketFrameHeadBytes + shift, '\0');
  frame.reserve(frame.size() + size);
  PutHead(SocketFrameKind::kMessage, frame.size(), size, &frame);
  if (place.size > 0) {
    PutNumber(static_cast<uint32_t>(frame.size() + place.offset), 8, 4, &frame);
    PutNumber(place.size, 12, 4, &frame);
  }
  return frame += payload;
}

std::string BeginFrame(const std::map<std::string, std::string>& headers) {
  v1::GatewayCallBegin message;
  message.mutable_headers()->insert(headers.begin(), headers.end());
  return FrameOf(SocketFrameKind::kBegin, message);
}

std::string HeartbeatFrame() {
  std::string frame(kSocketFrameHeadBytes, '\0');
  PutHead(SocketFrameKind::kHeartbeat, kSocketFrameHeadBytes, 0, &frame);
  return frame;
}

std::string EndFrame(const CallEnd& end) {
  v1::GatewayCallEnd message;
  message.set_code(end.status.error_code());
  message.set_message(end.status.error_message());
  message.set_status_details(end.status.error_details());
  message.mutable_trailers()->insert(end.trailers.begin(), end.trailers.end());
  return FrameOf(SocketFrameKind::kEnd, message);
}

}  // namespace tissueform
