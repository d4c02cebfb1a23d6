// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "google/protobuf/descriptor.h"
#include "grpcpp/support/byte_buffer.h"

#include "client/gateway/upstream_call.h"

// The frames of a call over a WebSocket as bytes (docs/gateway.md).
namespace tissueform {

constexpr size_t kSocketFrameHeadBytes = 32;

enum class SocketFrameKind : uint8_t {
  kStart = 1,
  kMessage = 2,
  kHalfClose = 3,
  kEnd = 4,
  kBegin = 5,
  kHeartbeat = 6,
};

struct SocketFrame {
  SocketFrameKind kind = SocketFrameKind::kMessage;
  absl::string_view payload;  // a view of the frame
};

// A frame of a client.
// Error: InvalidArgument, with what is wrong.
absl::StatusOr<SocketFrame> ParseClientFrame(absl::string_view frame);

// What a start asks for, checked: a method that is served, metadata that may be sent.
// Error: InvalidArgument; Unimplemented when the servers do not have the method.
absl::StatusOr<CallStart> ParseStart(absl::string_view payload);

// A message of a server. Where `type` is given, its longest `bytes` field lies at a multiple of 4.
// Error: Internal when gRPC cannot give the bytes.
absl::StatusOr<std::string> MessageFrame(const grpc::ByteBuffer& message,
                                         const google::protobuf::Descriptor* type);

// What the server has said before its first message.
std::string BeginFrame(const std::map<std::string, std::string>& headers);

// No payload: the connection works.
std::string HeartbeatFrame();

std::string EndFrame(const CallEnd& end);

}  // namespace tissueform
